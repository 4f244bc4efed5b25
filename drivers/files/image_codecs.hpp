// SPDX-License-Identifier: Apache-2.0
// The decoders behind image_file.hpp, one file per library. Included by image_file.cpp only.
//
// libpng and libjpeg report errors by longjmp. A function that calls setjmp here holds no object
// with a destructor and calls no C++ function that could; its caller owns the memory and throws.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include <opencv2/core/mat.hpp>

namespace plumb::codec {

enum class PngKind { kColor, kDepth };

/// @throws DataError if the sides are not in [1, max_side].
void CheckImageSide(const std::string& name, long width, long height, int max_side);

[[nodiscard]] cv::Mat DecodePng(std::span<const std::uint8_t> bytes, const std::string& name,
                                PngKind kind);
[[nodiscard]] cv::Mat DecodeJpeg(std::span<const std::uint8_t> bytes, const std::string& name);

}  // namespace plumb::codec
