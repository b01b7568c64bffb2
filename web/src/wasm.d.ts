declare module "virtual:wasm" {
  const gzipInBase64: string;
  export default gzipInBase64;
}
