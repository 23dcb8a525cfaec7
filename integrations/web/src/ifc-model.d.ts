/** `crates/enfilade-import/src/ifc/ifc_model.mjs`, which the build copies beside this. */
export function glbOfIfc(
  webIfc: object,
  bytes: Uint8Array,
  tell: (note: string) => void,
  locate?: (path: string, prefix: string) => string,
): Promise<Uint8Array[]>;
