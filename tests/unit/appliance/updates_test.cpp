// SPDX-License-Identifier: Apache-2.0
// Updates from a stick and from a channel, as a unit with an installer takes them.
#include "daemon/services/updates.hpp"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "daemon/loop/work_thread.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/unit/appliance/appliance_fixture.hpp"
#include "tests/unit/update/channel_server.hpp"
#include "tests/unit/update/fake_rauc.hpp"
#include "words/channel.hpp"
#include "words/upkeep.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using testing::FakeRauc;

class UpdatesTest : public testing::ApplianceTest {
 protected:
  UpdatesTest() {
    fs::create_directories(folder_ / "updates");
    fs::create_directories(folder_ / "sticks" / "sda1");
  }

  static void WriteBundle(const fs::path& file) {
    std::ofstream(file, std::ios::binary)
        << "hsqs" + std::string(8192, 'x') + std::string(7, '\0') + '\xFF';
  }
  void PlayWithRauc(const std::function<void(FakeRauc&)>& test) {
    Play([&] {
      FakeRauc rauc(message_bus_.address());
      On([&] {
        updates_ = std::make_unique<Updates>(
            loop_, *appliance_, shared_->session, std::make_unique<testing::FakeRestart>(),
            UpdatesOptions{
                .config = parts_.config.update,
                .state = folder_ / "state",
                .sticks = folder_ / "sticks",
                .first_look_after = std::chrono::milliseconds(1),
                .look_every = std::chrono::milliseconds(1),
                .look_again_after = std::chrono::milliseconds(1),
                .release = folder_ / "no-release",
                .bus_address = message_bus_.address(),
                .boot = "first",
                .run_in_background =
                    [this](std::function<void()> work) { return files_.Post(std::move(work)); },
                .changed = [] {},
                .log = [this](const Actor&, const char* action, const std::string& subject,
                              const Message&) { logged_.push_back(action + (" " + subject)); }});
      });
      EXPECT_TRUE(Becomes([&] { return updates_->GetUpdate().supported; }));
      test(rauc);
      On([&] { updates_.reset(); });
    });
  }
  Change InstallFromStick(const std::string& name) {
    const auto answer = std::make_shared<std::promise<Change>>();
    On([&] {
      updates_->InstallFromStick(kTester, name,
                                 [answer](const Change& change) { answer->set_value(change); });
    });
    return answer->get_future().get();
  }

  testing::PrivateBus message_bus_{folder_.path()};
  WorkThread files_{16};
  std::vector<std::string> logged_;
  std::unique_ptr<Updates> updates_;
};

TEST_F(UpdatesTest, ABundleOnAStickIsInstalledBesideTheOneOfItsNameThatWasUploaded) {
  WriteBundle(folder_ / "sticks" / "sda1" / "plumb-9.0.raucb");
  for (const char* name : {"a.raucb", "b.raucb", "c.raucb", "plumb-9.0.raucb"})
    std::ofstream(folder_ / "updates" / name) << "uploaded";
  PlayWithRauc([&](FakeRauc& rauc) {
    EXPECT_TRUE(Becomes([&] { return !updates_->StickBundles().empty(); }));
    EXPECT_EQ(InstallFromStick("other.raucb").message, say::upkeep::NoStick("other.raucb"));
    const Change change = InstallFromStick("plumb-9.0.raucb");
    EXPECT_EQ(change.result, ChangeResult::kDone) << change.message.English();
    EXPECT_THAT(rauc.installed(), ::testing::HasSubstr("/updates/.upload-"));
    EXPECT_TRUE(fs::exists(rauc.installed())) << "RAUC reads it";
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return !updates_->GetUpdate().installing; }));
    EXPECT_FALSE(fs::exists(rauc.installed()));
    EXPECT_EQ(fs::file_size(folder_ / "updates" / "plumb-9.0.raucb"), 8U) << "as it was uploaded";
    On([&] {
      EXPECT_THAT(logged_,
                  ElementsAre("update.refuse other.raucb", "update.install plumb-9.0.raucb",
                              "update.done plumb-9.0.raucb"));
    });
  });
}

TEST_F(UpdatesTest, WhatTheChannelGaveIsOfferedAndLoggedOnceUntilARestartIsNeeded) {
  testing::ChannelServer server;
  server.bundle_ = "hsqs" + std::string(100'000, 'x') + std::string(7, '\0') + '\xFF';
  server.NameBundle("plumb-99.0.raucb", "99.0");
  parts_.config.update.channel = server.url();
  parts_.config.update.channel_name = "stable";
  parts_.config.update.channel_key = server.key();
  fs::create_directories(folder_ / "state");
  PlayWithRauc([&](FakeRauc& rauc) {
    rauc.version = "99.0";
    const Message offer = say::channel::IsOffered("99.0", "plumb-99.0.raucb");
    const auto offered = [&] { return updates_->GetUpdate().offered; };
    EXPECT_TRUE(Becomes([&] { return offered() == offer; }));
    // One look follows the other.
    const int looks = server.num_looks_;
    EXPECT_TRUE(Becomes([&] { return server.num_looks_ > looks + 1; }));
    const auto answer = std::make_shared<std::promise<Change>>();
    On([&] {
      updates_->InstallUpdate(kTester, "plumb-99.0.raucb",
                              [answer](const Change& change) { answer->set_value(change); });
    });
    EXPECT_EQ(answer->get_future().get().message, Message());
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return updates_->GetUpdate().restart_needed; }));
    On([&] {
      EXPECT_EQ(offered(), Message()) << "it is installed";
      EXPECT_THAT(logged_,
                  ElementsAre("update.offer plumb-99.0.raucb", "update.install plumb-99.0.raucb",
                              "update.done plumb-99.0.raucb"));
    });
  });
}

}  // namespace
}  // namespace plumb
