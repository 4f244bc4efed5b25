// SPDX-License-Identifier: Apache-2.0
#include "drivers/importers/unpack.hpp"

#include <lz4frame.h>
#include <zstd.h>

#include <cstddef>
#include <memory>

#include "algo/base/errors.hpp"
#include "words/foreign.hpp"

namespace plumb {

void UnpackLz4(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) {
  LZ4F_dctx* created = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&created, LZ4F_VERSION)) != 0)
    throw DataError(say::foreign::BagPacking());
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(
      created, &LZ4F_freeDecompressionContext);
  std::size_t left = 1;
  while (left != 0) {
    std::size_t made = out.size(), used = packed.size();
    left = LZ4F_decompress(context.get(), out.data(), &made, packed.data(), &used, nullptr);
    if (LZ4F_isError(left) != 0 || (made == 0 && used == 0))
      throw DataError(say::foreign::BagPacking());
    out = out.subspan(made);
    packed = packed.subspan(used);
  }
  if (!out.empty() || !packed.empty()) throw DataError(say::foreign::BagPacking());
}

void UnpackZstd(std::span<const std::uint8_t> packed, std::span<std::uint8_t> out) {
  if (ZSTD_decompress(out.data(), out.size(), packed.data(), packed.size()) != out.size())
    throw DataError(say::foreign::BagPacking());
}

}  // namespace plumb
