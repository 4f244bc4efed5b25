// SPDX-License-Identifier: Apache-2.0
#include "drivers/stream/stream_protocol.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/nearest_name.hpp"
#include "words/recording.hpp"
#include "words/stream.hpp"

namespace plumb::stream {
namespace {

using nlohmann::json;

constexpr std::array kKeys = {"protocol", "version",      "name",   "serial",
                              "rate_hz",  "color_format", "camera", "recording"};
constexpr std::size_t kMaxName = 64;

void CheckKeys(const json& hello) {
  for (const auto& entry : hello.items()) {
    const std::string& key = entry.key();
    if (std::ranges::none_of(kKeys, [&](const char* known) { return key == known; }))
      throw DataError(say::stream::UnknownKey(key.substr(0, kMaxName), NearestName(key, kKeys)));
  }
}

/// A name for people and for files: printable and short.
std::string NameIn(const json& hello, const char* key) {
  const json value = hello.value(key, json(""));
  if (!value.is_string()) throw DataError(say::stream::NotAName(key, std::int64_t{kMaxName}));
  std::string name = value.get<std::string>();
  const bool is_plain = name.size() <= kMaxName &&
                        std::ranges::all_of(name, [](char c) { return c >= ' ' && c < 0x7f; });
  if (!is_plain) throw DataError(say::stream::NotAName(key, std::int64_t{kMaxName}));
  return name;
}

}  // namespace

Hello ParseHello(std::string_view text, bool incomplete) try {
  const json hello = ParseBoundedJson(text, 8);
  if (!hello.is_object() || hello.value("protocol", json()) != "plumb stream")
    throw DataError(say::stream::OtherProtocol());
  if (hello.value("version", json()) != kVersion)
    throw DataError(say::stream::OtherVersion(hello.value("version", json()).dump(), kVersion));
  CheckKeys(hello);
  Hello parsed;
  parsed.name = NameIn(hello, "name");
  parsed.serial = NameIn(hello, "serial");
  if (parsed.serial.empty() && !incomplete) throw DataError(say::stream::NoSerial());
  const json rate = hello.value("rate_hz", json(30.0));
  parsed.rate_hz = rate.is_number() ? rate.get<double>() : 0.0;
  if (!(parsed.rate_hz >= kLeastRate_hz && parsed.rate_hz <= kMostRate_hz))
    throw DataError(say::stream::Rate(kLeastRate_hz, kMostRate_hz));
  const json format = hello.value("color_format", json("rgb8"));
  if (format != "rgb8" && format != "bgr8") throw DataError(say::stream::ColorFormat());
  parsed.is_bgr = format == "bgr8";
  if (!hello.contains("camera") || !hello["camera"].is_object())
    throw DataError(say::stream::NoCamera());
  // JSON is YAML: the camera has the keys of camera.yaml, and one reader.
  parsed.camera_keys = hello["camera"];
  parsed.camera = ParseCameraFile(parsed.camera_keys.dump(), "camera");
  if (!incomplete && !parsed.camera.depth_scale) throw DataError(say::stream::NoUnit());
  if (!incomplete && parsed.camera.depth_camera_unknown)
    throw DataError(say::stream::NoDepthCamera());
  parsed.recording = hello.value("recording", json());
  return parsed;
} catch (const json::exception& error) {
  throw DataError(say::stream::NotRead(std::string(error.what()).substr(0, 200)));
}

std::optional<Kind> KindOf(const Header& header) {
  const bool known = header.kind >= static_cast<std::uint32_t>(Kind::kHello) &&
                     header.kind <= static_cast<std::uint32_t>(Kind::kError);
  if (header.magic != Header().magic || !known) return std::nullopt;
  return static_cast<Kind>(header.kind);
}

cv::Mat ImageFor(Kind kind, std::uint64_t size, const Hello& hello) {
  const bool is_depth = kind == Kind::kDepth;
  const Intrinsics& camera = is_depth ? hello.depth_intrinsics() : hello.camera.color;
  const std::uint64_t expected = static_cast<std::uint64_t>(camera.width) *
                                 static_cast<std::uint64_t>(camera.height) * (is_depth ? 2U : 3U);
  if (size != expected) {
    throw DataError(
        say::stream::ImageSize(is_depth ? say::recording::Depth() : say::recording::Colour(),
                               static_cast<std::int64_t>(size), static_cast<std::int64_t>(expected),
                               camera.width, camera.height));
  }
  return cv::Mat(camera.height, camera.width, is_depth ? CV_16UC1 : CV_8UC3);
}

}  // namespace plumb::stream
