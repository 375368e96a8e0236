"""Messages of `robomesh.proto`, as protoc generates them; nothing here is written by hand."""
