// SPDX-License-Identifier: Apache-2.0
// A web server with a channel of updates that holds one bundle.
#pragma once

#include <sodium.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "daemon/files/sha256.hpp"
#include "tests/support/fake_peer.hpp"

namespace plumb::testing {

class ChannelServer {
 public:
  ChannelServer() {
    crypto_sign_keypair(public_key_.data(), secret_key_.data());
    Publish();
  }

  [[nodiscard]] std::string url() const {
    return fmt::format("http://127.0.0.1:{}/plumb", server_.port());
  }
  /// In base64.
  [[nodiscard]] std::string key() const {
    std::string base64(sodium_base64_ENCODED_LEN(32, sodium_base64_VARIANT_ORIGINAL), '\0');
    sodium_bin2base64(base64.data(), base64.size(), public_key_.data(), public_key_.size(),
                      sodium_base64_VARIANT_ORIGINAL);
    base64.pop_back();
    return base64;
  }

  [[nodiscard]] nlohmann::json Bundle() const {
    return {{"name", name_},
            {"version", version_},
            {"bytes", bundle_.size()},
            {"sha256", Sha256Of(bundle_)},
            {"share", share_}};
  }
  void Publish() {
    index_ =
        nlohmann::json{
            {"format", 1}, {"channel", channel_}, {"number", number_}, {"bundles", {Bundle()}}}
            .dump();
    signature_.resize(crypto_sign_BYTES);
    crypto_sign_detached(reinterpret_cast<unsigned char*>(signature_.data()), nullptr,
                         reinterpret_cast<const unsigned char*>(index_.data()), index_.size(),
                         secret_key_.data());
    served_ = bundle_;
  }

  void NameBundle(const std::string& name, const std::string& version) {
    name_ = name;
    version_ = version;
    ++number_;
    Publish();
  }

  void Serve(PeerConnection& client) {
    const std::string head = client.ReadTo("\r\n\r\n");
    const auto answer = [&](const std::string& body) {
      client.Write(
          fmt::format("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{}", body.size(), body));
    };
    if (is_away_) return;
    if (head.starts_with("GET /plumb/index.json ")) {
      ++num_looks_;
      return answer(index_);
    }
    if (head.starts_with("GET /plumb/index.sig ")) return answer(signature_);
    if (!head.starts_with(fmt::format("GET /plumb/{} ", name_))) return;
    if (serve_bundle_) return serve_bundle_(client);
    const std::size_t range = head.find("Range: bytes=");
    const std::size_t from = range == std::string::npos ? 0 : std::stoul(head.substr(range + 13));
    last_from_ = from;
    const std::string rest = served_.substr(from);
    client.Write(fmt::format("HTTP/1.1 {}\r\nContent-Length: {}\r\n{}\r\n",
                             from == 0 ? "200 OK" : "206 Partial", rest.size(),
                             from == 0 ? std::string()
                                       : fmt::format("Content-Range: bytes {}-{}/{}\r\n", from,
                                                     served_.size() - 1, served_.size())));
    client.Write(rest.substr(0, cut_after_));
  }

  std::string bundle_ = std::string(100'000, 'b') + "end", served_, index_, signature_;
  std::string name_ = "plumb-0.3.1.raucb", version_ = "0.3.1", channel_ = "stable";
  std::int64_t number_ = 5;
  double share_ = 1.0;
  std::size_t cut_after_ = std::string::npos;
  std::function<void(PeerConnection&)> serve_bundle_;
  std::atomic<std::size_t> last_from_ = 0;
  std::atomic<int> num_looks_ = 0;
  std::atomic<bool> is_away_ = false;
  std::array<unsigned char, crypto_sign_PUBLICKEYBYTES> public_key_{};
  std::array<unsigned char, crypto_sign_SECRETKEYBYTES> secret_key_{};

 private:
  FakePeer server_{[this](PeerConnection& client) { Serve(client); }};  // last: it uses the others
};

}  // namespace plumb::testing
