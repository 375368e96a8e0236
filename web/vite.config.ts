import { defineConfig } from "vite";

export default defineConfig({
  base: "/",
  build: {
    outDir: "../services/console/page", // in the package that serves it, so that the wheel holds it
    emptyOutDir: true,
    target: "es2024",
    assetsDir: "assets",
    assetsInlineLimit: 0, // data: addresses would need a wider security policy
    chunkSizeWarningLimit: 900,
    modulePreload: { polyfill: false },
    rollupOptions: { input: ["index.html", "view.html"] },
  },
});
