import { defineConfig } from "vitest/config";

// Each file of these gets a process: a time zone, or the arrays of Node's own realm. The others share processes.
const ALONE = ["features/events/day", "i18n/format", "mesh/control/steps", "scene/**/*", "features/define/scene/*"].map(
  (each) => `tests/${each}.test.*`,
);
const ALL = "tests/**/*.test.{ts,tsx}";

export default defineConfig({
  test: {
    projects: [
      { extends: true, test: { name: "shared", include: [ALL], exclude: ALONE, pool: "vmThreads" } },
      { extends: true, test: { name: "alone", include: ALONE } },
    ],
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
