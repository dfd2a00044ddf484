// The viewer is a static site that runs under any path, so all of its URLs are relative; nothing is inlined, so that the
// content security policy of index.html needs no exceptions.
import { defineConfig } from "vite";

// The page says where luxel_rt.wasm is: beside it. The package's own default would become a second copy in assets/.
const oneRuntime = {
  name: "one-runtime",
  enforce: "pre",
  transform(code, id) {
    if (!id.endsWith("/luxel-three/index.js")) return null;
    const own = /new URL\((["'])\.\/luxel_rt\.wasm\1, import\.meta\.url\)/;
    if (!own.test(code)) this.error("luxel-three no longer names luxel_rt.wasm as this file expects");
    return { code: code.replace(own, "undefined"), map: null };
  },
};

export default defineConfig({
  base: "./",
  publicDir: false,
  plugins: [oneRuntime],
  build: {
    outDir: "dist",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 1500, // three.js
  },
});
