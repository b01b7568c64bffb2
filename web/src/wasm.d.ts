declare module "virtual:wasm" {
  const xzInBase64: string;
  export default xzInBase64;
}
