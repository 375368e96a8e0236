// The mesh's schema as Rust types, without a protoc installed.
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let schemas = "../../bus/schemas";
    println!("cargo:rerun-if-changed={schemas}/robomesh.proto");
    let files = protox::compile(["robomesh.proto"], [schemas])?;
    prost_build::Config::new().compile_fds(files)?;
    Ok(())
}
