// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/channel_index.hpp"

#include <sodium.h>

#include <algorithm>
#include <array>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "daemon/update/bundle_check.hpp"
#include "words/channel.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostBundles = 64, kLongestVersion = 32;
constexpr std::uint64_t kMostBundleBytes = std::uint64_t{64} << 30;

bool IsSigned(std::string_view text, std::string_view signature, std::string_view key) {
  std::array<unsigned char, crypto_sign_PUBLICKEYBYTES> bytes{};
  std::size_t length = 0;
  return signature.size() == crypto_sign_BYTES &&
         sodium_base642bin(bytes.data(), bytes.size(), key.data(), key.size(), nullptr, &length,
                           nullptr, sodium_base64_VARIANT_ORIGINAL) == 0 &&
         length == bytes.size() &&
         crypto_sign_verify_detached(reinterpret_cast<const unsigned char*>(signature.data()),
                                     reinterpret_cast<const unsigned char*>(text.data()),
                                     text.size(), bytes.data()) == 0;
}

bool IsDigest(const std::string& text) {
  return text.size() == 2 * crypto_hash_sha256_BYTES && std::ranges::all_of(text, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

ChannelBundle BundleOf(const nlohmann::json& json) {
  ChannelBundle bundle{.name = json.at("name").get<std::string>(),
                       .version = json.at("version").get<std::string>(),
                       .bytes = json.at("bytes").get<std::uint64_t>(),
                       .sha256 = json.at("sha256").get<std::string>(),
                       .share = json.at("share").get<double>()};
  if (!IsBundleName(bundle.name) || bundle.version.size() > kLongestVersion ||
      !WhyNoVersion(bundle.version).empty() || bundle.bytes == 0 ||
      bundle.bytes > kMostBundleBytes || !IsDigest(bundle.sha256) ||
      !(bundle.share >= 0 && bundle.share <= 1))
    throw DataError(say::channel::NotAnIndex(bundle.name.substr(0, 64)));
  return bundle;
}

}  // namespace

ChannelIndex ReadChannelIndex(std::string_view text, std::string_view signature,
                              std::string_view key, const std::string& channel,
                              std::int64_t least_number) {
  if (!IsSigned(text, signature, key)) throw DataError(say::channel::NoSignature());
  ChannelIndex index;
  try {
    const nlohmann::json json = ParseBoundedJson(text);
    if (json.at("format").get<int>() != 1) throw DataError(say::channel::NotAnIndex("format"));
    if (const auto found = json.at("channel").get<std::string>(); found != channel)
      throw DataError(say::channel::OtherChannel(found.substr(0, 64), channel));
    index.number = json.at("number").get<std::int64_t>();
    const nlohmann::json& bundles = json.at("bundles");
    if (!bundles.is_array() || bundles.size() > kMostBundles)
      throw DataError(say::channel::NotAnIndex("bundles"));
    for (const nlohmann::json& one : bundles) index.bundles.push_back(BundleOf(one));
  } catch (const nlohmann::json::exception& error) {
    throw DataError(say::channel::NotAnIndex(error.what()));
  }
  if (index.number < least_number)
    throw DataError(say::channel::OlderIndex(index.number, least_number));
  return index;
}

double PlaceInFleet(const std::string& serial, const ChannelBundle& bundle) {
  const std::string text = serial + "\n" + bundle.sha256;
  std::array<unsigned char, crypto_hash_sha256_BYTES> digest{};
  crypto_hash_sha256(digest.data(), reinterpret_cast<const unsigned char*>(text.data()),
                     text.size());
  return (256.0 * digest[0] + digest[1]) / 65536.0;
}

std::optional<ChannelBundle> OfferedTo(const ChannelIndex& index, const std::string& serial,
                                       const std::string& version) {
  std::optional<ChannelBundle> offered;
  for (const ChannelBundle& bundle : index.bundles) {
    if (!IsOlder(offered ? offered->version : version, bundle.version)) continue;
    if (PlaceInFleet(serial, bundle) < bundle.share) offered = bundle;
  }
  return offered;
}

}  // namespace plumb
