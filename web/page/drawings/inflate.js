// SPDX-License-Identifier: Apache-2.0
/// Unpacks the zlib stream that begins there.
export const inflated = (buffer, from) => new Response(new Blob([buffer.slice(from)]).stream()
  .pipeThrough(new DecompressionStream('deflate'))).arrayBuffer();
