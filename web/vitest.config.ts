import { defineConfig } from "vitest/config";

export default defineConfig({
  test: {
    dir: "tests",
    environment: "happy-dom",
    reporters: ["dot"],
    testTimeout: 60_000,
    hookTimeout: 60_000,
    unstubGlobals: true,
    restoreMocks: true,
    coverage: {
      include: ["src/**"],
      exclude: ["src/gen/**"],
      reporter: ["json-summary"],
      reportsDirectory: "node_modules/.coverage",
    },
  },
});
