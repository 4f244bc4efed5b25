// SPDX-License-Identifier: Apache-2.0
// A channel on a server that is not always well-meaning.
#include "daemon/update/channel.hpp"

#include <sodium.h>

#include <array>
#include <atomic>
#include <condition_variable>
#include <fstream>
#include <mutex>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/fake_peer.hpp"
#include "tests/support/temp_folder.hpp"
#include "words/channel.hpp"

namespace plumb {
namespace {

using testing::FakePeer;
using testing::PeerConnection;

std::string DigestOfText(const std::string& text) {
  std::array<unsigned char, crypto_hash_sha256_BYTES> digest{};
  crypto_hash_sha256(digest.data(), reinterpret_cast<const unsigned char*>(text.data()),
                     text.size());
  return fmt::format("{:02x}", fmt::join(digest, ""));
}

class ChannelTest : public ::testing::Test {
 protected:
  ChannelTest() {
    crypto_sign_keypair(public_key_.data(), secret_key_.data());
    std::string base64(sodium_base64_ENCODED_LEN(32, sodium_base64_VARIANT_ORIGINAL), '\0');
    sodium_bin2base64(base64.data(), base64.size(), public_key_.data(), public_key_.size(),
                      sodium_base64_VARIANT_ORIGINAL);
    base64.pop_back();
    options_ = {.url = fmt::format("http://127.0.0.1:{}/plumb", server_.port()),
                .key = base64,
                .folder = folder_ / "updates",
                .seen = folder_ / "seen",
                .serial = "PL-0007",
                .version = "0.3.0"};
    Publish();
  }

  nlohmann::json Bundle() const {
    return {{"name", "plumb-0.3.1.raucb"},
            {"version", version_},
            {"bytes", bundle_.size()},
            {"sha256", DigestOfText(bundle_)},
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

  void Serve(PeerConnection& client) {
    const std::string head = client.ReadTo("\r\n\r\n");
    const auto answer = [&](const std::string& body) {
      client.Write(
          fmt::format("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{}", body.size(), body));
    };
    if (head.starts_with("GET /plumb/index.json ")) return answer(index_);
    if (head.starts_with("GET /plumb/index.sig ")) return answer(signature_);
    if (!head.starts_with("GET /plumb/plumb-0.3.1.raucb ")) return;
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

  ChannelLook Look() { return LookAtChannel(options_, stop_.get_token()); }
  std::string Fetched() const {
    const auto file = options_.folder / "plumb-0.3.1.raucb";
    return std::filesystem::exists(file) ? ReadTextFile(file, 1 << 20) : "";
  }
  /// Files of the folder, parts included.
  int NumFiles() const {
    int count = 0;
    std::error_code ignored;
    for ([[maybe_unused]] const auto& one :
         std::filesystem::directory_iterator(options_.folder, ignored))
      ++count;
    return count;
  }

  std::string bundle_ = std::string(100'000, 'b') + "end", served_, index_, signature_;
  std::string version_ = "0.3.1", channel_ = "stable";
  std::int64_t number_ = 5;
  double share_ = 1.0;
  std::size_t cut_after_ = std::string::npos;
  std::function<void(PeerConnection&)> serve_bundle_;
  std::atomic<std::size_t> last_from_ = 0;
  std::array<unsigned char, crypto_sign_PUBLICKEYBYTES> public_key_{};
  std::array<unsigned char, crypto_sign_SECRETKEYBYTES> secret_key_{};
  testing::TempFolder folder_;
  FakePeer server_{[this](PeerConnection& client) { Serve(client); }};
  ChannelOptions options_;
  std::stop_source stop_;
};

TEST_F(ChannelTest, WhatTheIndexNamesIsFetchedOnce) {
  const ChannelLook look = Look();
  EXPECT_EQ(look.failure.English(), "");
  EXPECT_EQ(look.name, "plumb-0.3.1.raucb");
  EXPECT_EQ(look.version, "0.3.1");
  EXPECT_EQ(Fetched(), bundle_);
  serve_bundle_ = [](PeerConnection&) { ADD_FAILURE() << "asked again"; };
  EXPECT_EQ(Look().name, "plumb-0.3.1.raucb");
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(ChannelTest, AnIndexThatIsNotSignedByTheKeyIsRefused) {
  index_[index_.find("0.3.1")] = '9';
  EXPECT_EQ(Look().failure, say::channel::NoSignature());
  Publish();
  signature_[7] ^= 1;
  EXPECT_EQ(Look().failure, say::channel::NoSignature());
  signature_.clear();
  EXPECT_EQ(Look().failure, say::channel::NoSignature());
  EXPECT_EQ(NumFiles(), 0);
}

TEST_F(ChannelTest, AnOlderIndexAndAnOlderVersionAreRefused) {
  (void)Look();
  number_ = 4;
  Publish();
  EXPECT_EQ(Look().failure, say::channel::OlderIndex(4, 5));
  std::filesystem::remove_all(options_.folder);
  number_ = 6;
  for (const char* version : {"0.2.9", "0.3.0", "0.3"}) {
    version_ = version;
    Publish();
    const ChannelLook look = Look();
    EXPECT_EQ(look.name, "") << version;
    EXPECT_TRUE(look.failure.empty());
  }
  EXPECT_EQ(NumFiles(), 0);
}

TEST_F(ChannelTest, AnotherChannelsIndexIsRefused) {
  channel_ = "test";
  Publish();
  EXPECT_EQ(Look().failure, say::channel::OtherChannel("test", "stable"));
}

TEST_F(ChannelTest, ADownloadThatBreaksOffIsContinued) {
  cut_after_ = 40'000;
  EXPECT_EQ(Look().failure, say::channel::Incomplete("plumb-0.3.1.raucb", 40'000, 100'003));
  EXPECT_EQ(Fetched(), "");
  cut_after_ = std::string::npos;
  EXPECT_EQ(Look().name, "plumb-0.3.1.raucb");
  EXPECT_EQ(last_from_, 40'000U);
  EXPECT_EQ(Fetched(), bundle_);
}

TEST_F(ChannelTest, AFileThatChangedBetweenTwoPartsIsThrownAway) {
  cut_after_ = 40'000;
  (void)Look();
  cut_after_ = std::string::npos;
  served_ = std::string(bundle_.size(), 'x');
  EXPECT_EQ(Look().failure, say::channel::OtherContents("plumb-0.3.1.raucb"));
  EXPECT_EQ(NumFiles(), 0) << "nothing of it may be continued";
  served_ = bundle_;
  EXPECT_EQ(Look().failure, Message());
  EXPECT_EQ(last_from_, 0U);
  EXPECT_EQ(Fetched(), bundle_);
}

TEST_F(ChannelTest, APartOfWhatTheIndexNamedBeforeIsNotContinued) {
  cut_after_ = 40'000;
  (void)Look();
  cut_after_ = std::string::npos;
  bundle_ = std::string(100'003, 'c');
  number_ = 6;
  Publish();
  EXPECT_EQ(Look().failure, Message());
  EXPECT_EQ(last_from_, 0U);
  EXPECT_EQ(Fetched(), bundle_);
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(ChannelTest, AServerThatDoesNotContinueIsAskedFromTheBeginning) {
  cut_after_ = 40'000;
  (void)Look();
  serve_bundle_ = [this](PeerConnection& client) {
    client.Write(
        fmt::format("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n{}", bundle_.size(), bundle_));
  };
  EXPECT_FALSE(Look().failure.empty());
  EXPECT_EQ(Look().failure, Message());
  EXPECT_EQ(Fetched(), bundle_);
}

TEST_F(ChannelTest, AnEndlessBodyEndsAtTheSizeOfTheIndex) {
  serve_bundle_ = [](PeerConnection& client) {
    client.Write("HTTP/1.1 200 OK\r\n\r\n");
    while (client.Write(std::string(4096, 'b'))) {
    }
  };
  EXPECT_FALSE(Look().failure.empty());
  EXPECT_EQ(Fetched(), "");
  for (const auto& file : std::filesystem::directory_iterator(options_.folder))
    EXPECT_LE(file.file_size(), bundle_.size());
}

TEST_F(ChannelTest, AnEndlessIndexIsNotRead) {
  index_ = std::string(kMaxIndexBytes + 1, ' ');
  EXPECT_FALSE(Look().failure.empty());
}

TEST_F(ChannelTest, ARedirectionIsNotFollowedWhereverItLeads) {
  std::ofstream(folder_ / "local") << bundle_;
  for (const std::string& to : {fmt::format("file://{}", (folder_ / "local").string()),
                                options_.url + "/elsewhere", std::string("ftp://127.0.0.1/x")}) {
    serve_bundle_ = [&](PeerConnection& client) {
      client.Write(
          fmt::format("HTTP/1.1 302 Elsewhere\r\nLocation: {}\r\nContent-Length: 0\r\n\r\n", to));
    };
    EXPECT_EQ(Look().failure, say::channel::Unreachable("plumb-0.3.1.raucb", "HTTP 302")) << to;
    EXPECT_EQ(Fetched(), "");
  }
}

TEST_F(ChannelTest, APageOfAnErrorIsNoPartOfTheBundle) {
  serve_bundle_ = [](PeerConnection& client) {
    client.Write("HTTP/1.1 404 None\r\nContent-Length: 5\r\n\r\nsorry");
  };
  EXPECT_FALSE(Look().failure.empty());
  serve_bundle_ = {};
  EXPECT_EQ(Look().failure, Message());
  EXPECT_EQ(last_from_, 0U);
  EXPECT_EQ(Fetched(), bundle_);
}

TEST_F(ChannelTest, AnIndexThatIsSignedMayStillNotLeaveTheFolder) {
  for (const char* name : {"../x.raucb", "/x.raucb", ".x.raucb", "-x.raucb", "x", "a/b.raucb"}) {
    nlohmann::json bundle = Bundle();
    bundle["name"] = name;
    const std::string text = nlohmann::json{
        {"format", 1},
        {"channel", "stable"},
        {"number", 9},
        {"bundles", {bundle}}}.dump();
    std::string signature(crypto_sign_BYTES, '\0');
    crypto_sign_detached(reinterpret_cast<unsigned char*>(signature.data()), nullptr,
                         reinterpret_cast<const unsigned char*>(text.data()), text.size(),
                         secret_key_.data());
    EXPECT_THROW((void)ReadChannelIndex(text, signature, options_.key, "stable", 0), DataError)
        << name;
  }
}

TEST_F(ChannelTest, AShareOfTheFleetGetsABundleAndAHigherOneKeepsThem) {
  ChannelBundle bundle{
      .name = "a-1.raucb", .version = "1", .bytes = 1, .sha256 = "0", .share = 0.25};
  int few = 0, more = 0;
  for (int unit = 0; unit < 1000; ++unit) {
    const std::string serial = fmt::format("PL-{:04}", unit);
    bundle.share = 0.25;
    const bool is_early = OfferedTo({.bundles = {bundle}}, serial, "0.9").has_value();
    bundle.share = 0.5;
    const bool is_later = OfferedTo({.bundles = {bundle}}, serial, "0.9").has_value();
    few += is_early ? 1 : 0;
    more += is_later ? 1 : 0;
    EXPECT_TRUE(is_later || !is_early) << serial;
  }
  // Binomial: three standard deviations are 41 and 47.
  EXPECT_NEAR(few, 250, 41);
  EXPECT_NEAR(more, 500, 47);
}

TEST_F(ChannelTest, TheWatchLooksAgainAfterAFailure) {
  signature_.clear();
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<ChannelLook> looks;
  options_.first_after = options_.again_after = std::chrono::milliseconds(1);
  const ChannelWatch watch(options_, [&](const ChannelLook& look) {
    const std::lock_guard lock(mutex);
    looks.push_back(look);
    changed.notify_all();
  });
  std::unique_lock lock(mutex);
  ASSERT_TRUE(changed.wait_for(lock, std::chrono::seconds(30), [&] { return looks.size() >= 2; }));
  EXPECT_EQ(looks[1].failure, say::channel::NoSignature());
}

}  // namespace
}  // namespace plumb
