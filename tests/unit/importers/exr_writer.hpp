// SPDX-License-Identifier: Apache-2.0
// Writes OpenEXR images for tests, independently of the reader.
#pragma once

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include <opencv2/core.hpp>

namespace plumb::testing {

struct ExrOptions {
  std::uint8_t compression = 3;  ///< 0 none, 1 runs, 2 zlib by lines, 3 zlib by 16 lines.
  std::string channel = "R";     ///< Of depth.
  /// A channel of 1s in floats beside it, before or behind by its name; empty: none.
  std::string beside = {};
  bool half = false;  ///< 16 bits, for values from 0.0001 to 60000.
  int top = 0;        ///< Number of the first line.
};

class ExrWriter {
 public:
  ExrWriter(const cv::Mat& depth_m, const ExrOptions& options)
      : depth_m_(depth_m), options_(options) {}

  std::vector<std::uint8_t> Write() {
    Put(std::uint32_t{20000630});
    Put(std::uint32_t{2});
    WriteHeader();
    const int per_chunk = options_.compression == 3 ? 16 : 1;
    std::vector<std::vector<std::uint8_t>> chunks;
    for (int row = 0; row < depth_m_.rows; row += per_chunk)
      chunks.push_back(Packed(LinesOf(row, std::min(depth_m_.rows, row + per_chunk))));
    std::uint64_t at = file_.size() + 8 * chunks.size();
    for (const auto& chunk : chunks) {
      Put(at);
      at += 8 + chunk.size();
    }
    for (std::size_t i = 0; i < chunks.size(); ++i) {
      Put(options_.top + static_cast<int>(i) * per_chunk);
      Put(static_cast<std::uint32_t>(chunks[i].size()));
      file_.insert(file_.end(), chunks[i].begin(), chunks[i].end());
    }
    return file_;
  }

 private:
  template <typename Number>
  static void Put(std::vector<std::uint8_t>& to, Number number) {
    std::uint8_t bytes[sizeof number];
    std::memcpy(bytes, &number, sizeof number);
    to.insert(to.end(), bytes, bytes + sizeof number);
  }
  template <typename Number>
  void Put(Number number) {
    Put(file_, number);
  }
  static void Text(std::vector<std::uint8_t>& to, const std::string& text) {
    to.insert(to.end(), text.begin(), text.end());
    to.push_back(0);
  }
  void Attribute(const char* name, const char* type, const std::vector<std::uint8_t>& value) {
    Text(file_, name);
    Text(file_, type);
    Put(static_cast<std::uint32_t>(value.size()));
    file_.insert(file_.end(), value.begin(), value.end());
  }
  [[nodiscard]] std::vector<std::string> Channels() const {
    std::vector<std::string> names = {options_.channel};
    if (!options_.beside.empty()) names.push_back(options_.beside);
    std::ranges::sort(names);
    return names;
  }
  void WriteHeader() {
    std::vector<std::uint8_t> channels;
    for (const std::string& name : Channels()) {
      Text(channels, name);
      Put(channels, std::int32_t{name == options_.channel && options_.half ? 1 : 2});
      Put(channels, std::int32_t{0});
      Put(channels, std::int32_t{1});
      Put(channels, std::int32_t{1});
    }
    channels.push_back(0);
    Attribute("channels", "chlist", channels);
    Attribute("compression", "compression", {options_.compression});
    std::vector<std::uint8_t> window;
    for (const int side : {0, options_.top, depth_m_.cols - 1, options_.top + depth_m_.rows - 1})
      Put(window, std::int32_t{side});
    Attribute("dataWindow", "box2i", window);
    Attribute("displayWindow", "box2i", window);
    Attribute("lineOrder", "lineOrder", {0});
    file_.push_back(0);
  }
  // Normal numbers only, towards zero.
  static std::uint16_t HalfOf(float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    if (value == 0) return 0;
    return static_cast<std::uint16_t>((((bits >> 23) - 112) << 10) | ((bits >> 13) & 1023));
  }
  [[nodiscard]] std::vector<std::uint8_t> LinesOf(int from, int to) const {
    std::vector<std::uint8_t> bytes;
    for (int row = from; row < to; ++row)
      for (const std::string& name : Channels())
        for (int c = 0; c < depth_m_.cols; ++c) {
          const float value = depth_m_.at<float>(row, c);
          if (name != options_.channel) {
            Put(bytes, 1.0F);
          } else if (options_.half) {
            Put(bytes, HalfOf(value));
          } else {
            Put(bytes, value);
          }
        }
    return bytes;
  }
  // Even bytes first, then differences.
  [[nodiscard]] std::vector<std::uint8_t> Packed(const std::vector<std::uint8_t>& lines) const {
    if (options_.compression == 0) return lines;
    std::vector<std::uint8_t> turned;
    for (const std::size_t odd : {0U, 1U})
      for (std::size_t i = odd; i < lines.size(); i += 2) turned.push_back(lines[i]);
    for (std::size_t i = turned.size() - 1; i > 0; --i)
      turned[i] = static_cast<std::uint8_t>(turned[i] - turned[i - 1] + 128);
    const std::vector<std::uint8_t> packed =
        options_.compression == 1 ? InRuns(turned) : Deflated(turned);
    return packed.size() < lines.size() ? packed : lines;
  }
  static std::vector<std::uint8_t> Deflated(const std::vector<std::uint8_t>& bytes) {
    uLongf size = compressBound(bytes.size());
    std::vector<std::uint8_t> packed(size);
    compress(packed.data(), &size, bytes.data(), bytes.size());
    packed.resize(size);
    return packed;
  }
  static std::vector<std::uint8_t> InRuns(const std::vector<std::uint8_t>& bytes) {
    std::vector<std::uint8_t> packed;
    for (std::size_t i = 0; i < bytes.size();) {
      std::size_t same = i;
      while (same < bytes.size() && bytes[same] == bytes[i] && same - i < 127) ++same;
      if (same - i >= 3) {
        packed.push_back(static_cast<std::uint8_t>(same - i - 1));
        packed.push_back(bytes[i]);
        i = same;
      } else {  // One byte as it is; a real writer would collect more of them.
        packed.push_back(static_cast<std::uint8_t>(-1));
        packed.push_back(bytes[i++]);
      }
    }
    return packed;
  }

  const cv::Mat& depth_m_;
  const ExrOptions options_;
  std::vector<std::uint8_t> file_;
};

/// @param depth_m  CV_32FC1.
inline std::vector<std::uint8_t> ExrFile(const cv::Mat& depth_m, const ExrOptions& options = {}) {
  return ExrWriter(depth_m, options).Write();
}

}  // namespace plumb::testing
