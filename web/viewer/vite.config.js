// The viewer is a static site that runs under any path, so all of its URLs are relative; nothing is inlined, so that the
// content security policy of index.html needs no exceptions.
import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  publicDir: false,
  build: {
    outDir: process.env.LUXEL_VIEWER_OUT ?? "dist",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1500, // three.js
  },
});
