// SPDX-License-Identifier: Apache-2.0
// A channel on a server that is not always well-meaning.
#include "daemon/update/channel.hpp"

#include <sodium.h>

#include <atomic>
#include <condition_variable>
#include <fstream>
#include <mutex>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "algo/base/errors.hpp"
#include "daemon/files/sha256.hpp"
#include "daemon/update/channel_memory.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/update/channel_server.hpp"
#include "web/model/kept_free.hpp"
#include "words/channel.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

using testing::PeerConnection;

class ChannelTest : public ::testing::Test, protected testing::ChannelServer {
 protected:
  ChannelTest() {
    options_ = {.url = url(),
                .key = key(),
                .folder = folder_ / "updates",
                .state = folder_ / "state",
                .serial = "PL-0007",
                .version = "0.3.0"};
    std::filesystem::create_directories(options_.state);
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

  testing::TempFolder folder_;
  ChannelOptions options_;
  std::stop_source stop_;
};

TEST_F(ChannelTest, WhatTheIndexNamesIsFetchedOnce) {
  const ChannelLook look = Look();
  EXPECT_EQ(look.failure.English(), "");
  EXPECT_EQ(look.name, "plumb-0.3.1.raucb");
  EXPECT_EQ(look.version, "0.3.1");
  EXPECT_TRUE(look.is_new);
  EXPECT_EQ(Fetched(), bundle_);
  serve_bundle_ = [](PeerConnection&) { ADD_FAILURE() << "asked again"; };
  const ChannelLook again = Look();
  EXPECT_EQ(again.name, "plumb-0.3.1.raucb");
  EXPECT_FALSE(again.is_new) << "it was logged";
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(ChannelTest, AnotherFileUnderTheSameNameIsFetchedAnew) {
  (void)Look();
  bundle_ = std::string(100'003, 'c');
  number_ = 6;
  Publish();
  EXPECT_TRUE(Look().is_new);
  EXPECT_EQ(Fetched(), bundle_);
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(ChannelTest, WhatAPersonPutThereIsNeitherReplacedNorRemovedNorOffered) {
  const auto put = [&](const char* name, const std::string& text) {
    std::filesystem::create_directories(options_.folder);
    WriteWholeFile(options_.folder / name, std::string_view(text));
  };
  for (const std::string& other : {std::string(bundle_.size(), 'x'), std::string("short")}) {
    put("plumb-0.3.1.raucb", other);
    const ChannelLook look = Look();
    EXPECT_EQ(look.failure, say::channel::OtherFile("plumb-0.3.1.raucb"));
    EXPECT_EQ(look.name, "");
    EXPECT_EQ(Fetched(), other);
  }
  put("plumb-0.3.1.raucb", bundle_);
  EXPECT_EQ(Look().name, "plumb-0.3.1.raucb") << "size and digest are those of the index";
  EXPECT_FALSE(Look().is_new);
  put("mine.raucb", "mine");
  NameBundle("plumb-0.3.2.raucb", "0.3.2");
  EXPECT_EQ(Look().name, "plumb-0.3.2.raucb");
  EXPECT_EQ(Fetched(), bundle_) << "it was a person's";
  EXPECT_EQ(NumFiles(), 3);
}

TEST_F(ChannelTest, WhatAPersonPutInThePlaceOfTheChannelsStays) {
  (void)Look();
  WriteWholeFile(options_.folder / "upload", std::string_view("a person's"));
  std::filesystem::rename(options_.folder / "upload", options_.folder / name_);
  EXPECT_EQ(Look().failure, say::channel::OtherFile(name_));
  NameBundle("plumb-0.3.2.raucb", "0.3.2");
  EXPECT_EQ(Look().name, "plumb-0.3.2.raucb");
  EXPECT_EQ(Fetched(), "a person's");
}

TEST_F(ChannelTest, OneBundleInTheFolderIsTheChannels) {
  (void)Look();
  NameBundle("plumb-0.3.2.raucb", "0.3.2");
  EXPECT_EQ(Look().name, "plumb-0.3.2.raucb");
  EXPECT_EQ(NumFiles(), 1);
  // Withdrawn again: what the unit removed itself may come back.
  NameBundle("plumb-0.3.1.raucb", "0.3.1");
  EXPECT_EQ(Look().name, "plumb-0.3.1.raucb");
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(ChannelTest, WhatAPersonRemovedIsNotFetchedAgain) {
  (void)Look();
  std::filesystem::remove(options_.folder / "plumb-0.3.1.raucb");
  serve_bundle_ = [](PeerConnection&) { ADD_FAILURE() << "asked again"; };
  const ChannelLook look = Look();
  EXPECT_EQ(look.name, "");
  EXPECT_EQ(look.failure, Message());
  serve_bundle_ = {};
  bundle_ += "!";
  ++number_;
  Publish();
  EXPECT_EQ(Look().name, "plumb-0.3.1.raucb") << "other contents are another bundle";
}

TEST_F(ChannelTest, ADownloadLeavesRoomForScans) {
  std::uint64_t free = bundle_.size() + kKeptFree - 1;
  options_.free_bytes = [&](const std::filesystem::path&) { return free; };
  EXPECT_TRUE(Look().failure.Is(say::update::kDiskFull)) << Look().failure.English();
  EXPECT_EQ(Fetched(), "");
  ++free;
  // The disk does not see the file grow: what is still to come fits at each step.
  EXPECT_EQ(Look().failure, Message());
  EXPECT_EQ(Fetched(), bundle_);
}

TEST_F(ChannelTest, ADownloadStopsWhenScansNeedTheRoom) {
  int num_looks = 0;
  options_.free_bytes = [&](const std::filesystem::path&) {
    return ++num_looks > 2 ? kKeptFree : kKeptFree + bundle_.size();
  };
  EXPECT_TRUE(Look().failure.Is(say::update::kDiskFull));
  EXPECT_EQ(Fetched(), "");
  EXPECT_EQ(NumFiles(), 1) << "the part, to be continued";
  num_looks = -1000;
  EXPECT_EQ(Look().failure, Message());
  EXPECT_GT(last_from_, 0U);
  EXPECT_EQ(Fetched(), bundle_);
}

TEST_F(ChannelTest, NothingIsRemovedOrFetchedWhileABundleIsInstalled) {
  (void)Look();
  NameBundle("plumb-0.3.2.raucb", "0.3.2");
  options_.may_fetch = [] { return false; };
  EXPECT_TRUE(Look().is_postponed);
  EXPECT_EQ(NumFiles(), 1);
  EXPECT_TRUE(std::filesystem::exists(options_.folder / "plumb-0.3.1.raucb"));
  options_.may_fetch = [] { return true; };
  EXPECT_EQ(Look().name, "plumb-0.3.2.raucb");
}

TEST_F(ChannelTest, PartsGoWhenNoChannelIsLookedAtAnyMore) {
  cut_after_ = 40'000;
  (void)Look();
  WriteWholeFile(options_.folder / "mine.raucb", std::string_view("mine"));
  RemoveChannelParts(options_.folder);
  EXPECT_EQ(NumFiles(), 1);
}

TEST_F(ChannelTest, AMemoryThatCannotBeReadIsNotTakenForAnEmptyOne) {
  (void)Look();
  const auto file = options_.state / kChannelMemoryFile;
  const std::string good = ReadTextFile(file, 4096);
  number_ = 4;
  Publish();
  for (const std::string& text :
       {std::string(), std::string("1x"), std::string("{}"), std::string("[]"),
        good.substr(0, good.size() / 2), std::string(70'000, ' '),
        std::string(R"({"newest":{},"fetched":[{"name":"../x.raucb","sha256":"","inode":1,)"
                    R"("bytes":1,"modified_ns":1}]})")}) {
    WriteWholeFile(file, std::string_view(text));
    EXPECT_TRUE(Look().failure.Is(say::channel::kMemoryUnreadable)) << text.substr(0, 40);
    EXPECT_THAT(Look().failure.English(), ::testing::HasSubstr(file.string()));
  }
  WriteWholeFile(file, std::string_view(good));
  EXPECT_EQ(Look().failure, say::channel::OlderIndex(4, 5));
}

TEST_F(ChannelTest, EachChannelAndKeyHasItsOwnOrderOfIndexes) {
  options_.channel = channel_ = "test";
  number_ = 40;
  Publish();
  EXPECT_EQ(Look().failure, Message());
  options_.channel = channel_ = "stable";
  number_ = 17;
  Publish();
  EXPECT_EQ(Look().failure, Message());
  number_ = 16;
  Publish();
  EXPECT_EQ(Look().failure, say::channel::OlderIndex(16, 17));
  EXPECT_NE(NameOfOrder("stable", options_.key), NameOfOrder("stable", "another"));
}

/// A file that the disk cannot read is not one whose contents are others.
TEST_F(ChannelTest, AReadErrorIsSaidAsOne) {
  // Reading one's own memory from the address 0 on is an input/output error.
  std::filesystem::create_symlink("/proc/self/mem", folder_ / "bad");
  EXPECT_THROW((void)SumOfFile(folder_ / "bad"), IoError);
}

TEST_F(ChannelTest, ADigestEndsWithAStopRequest) {
  std::filesystem::create_directories(options_.folder);
  std::ofstream(options_.folder / "plumb-0.3.1.raucb");
  std::filesystem::resize_file(options_.folder / "plumb-0.3.1.raucb", bundle_.size());
  (void)stop_.request_stop();
  EXPECT_THROW((void)SumOfFile(options_.folder / "plumb-0.3.1.raucb", stop_.get_token()),
               Interrupted);
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

TEST_F(ChannelTest, TheWatchKeepsAnOfferWhileTheServerIsAway) {
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<ChannelLook> looks;
  options_.first_after = options_.again_after = options_.every = std::chrono::milliseconds(1);
  const ChannelWatch watch(options_, [&](const ChannelLook& look) {
    const std::lock_guard lock(mutex);
    if (looks.empty()) is_away_ = true;
    if (looks.size() == 1) is_away_ = false;
    looks.push_back(look);
    changed.notify_all();
  });
  std::unique_lock lock(mutex);
  ASSERT_TRUE(changed.wait_for(lock, std::chrono::seconds(30), [&] { return looks.size() >= 3; }));
  EXPECT_TRUE(looks[0].is_new);
  EXPECT_FALSE(looks[1].failure.empty());
  for (const ChannelLook& look : looks) EXPECT_EQ(look.name, "plumb-0.3.1.raucb");
  EXPECT_EQ(looks[2].failure, Message());
  EXPECT_FALSE(looks[1].is_new || looks[2].is_new) << "logged once";
}

TEST(ChannelIndexTest, ASystemWhoseVersionHasAnotherFormIsOfferedWhatIsLater) {
  const ChannelIndex index{
      .bundles = {{.name = "a-1.raucb", .version = "0.3.1", .bytes = 1, .sha256 = "0"}}};
  EXPECT_TRUE(OfferedTo(index, "PL-1", "0.3.0-1"));
  EXPECT_FALSE(OfferedTo(index, "PL-1", "0.3.1-1"));
}

}  // namespace
}  // namespace plumb
