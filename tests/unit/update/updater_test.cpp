// SPDX-License-Identifier: Apache-2.0
// Updates through a RAUC of our own making on a bus of our own.
#include "daemon/update/updater.hpp"
#include "daemon/update/bundle_check.hpp"

#include <unistd.h>

#include <filesystem>
#include <memory>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/files/unix_socket.hpp"
#include "tests/unit/update/updater_fixture.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using testing::FakeRauc;
using ::testing::HasSubstr;
using testing::UpdaterTest;

TEST_F(UpdaterTest, WithoutABusItSaysThatThereIsNoInstaller) {
  RunBesideLoop([&] {
    bus_.Stop();
    Start();
    EXPECT_FALSE(StatusNow().supported);
    EXPECT_THAT(StatusNow().message.English(),
                HasSubstr("this machine has no program that installs updates"));
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kConflict);
  });
}

TEST_F(UpdaterTest, ABusWithoutRaucIsTheSame) {
  RunBesideLoop([&] {
    Start();
    ::usleep(200000);  // time without an answer is what is tested: the status must hold
    EXPECT_FALSE(StatusNow().supported);
    EXPECT_THAT(Install("plumb-9.0.raucb").message.English(),
                HasSubstr("no program that installs updates"));
  });
}

TEST_F(UpdaterTest, AGoodBundleIsInstalledWithProgress) {
  PlayWithRauc([&](FakeRauc& rauc) {
    EXPECT_EQ(StatusNow().slot, "A");
    EXPECT_THAT(StatusNow().bundles, ::testing::ElementsAre("plumb-9.0.raucb"));
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    EXPECT_EQ(rauc.installed(), (folder_ / "updates" / "plumb-9.0.raucb").string());
    EXPECT_TRUE(Becomes([&] { return StatusNow().fraction == 0.4; }));
    EXPECT_TRUE(StatusNow().installing);
    EXPECT_EQ(StatusNow().message.English(), "Copying image to rootfs.1");
    EXPECT_THAT(Install("plumb-9.0.raucb").message.English(), HasSubstr("being installed"));
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_THAT(StatusNow().message.English(), HasSubstr("restart the appliance"));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: ");
    EXPECT_GE(num_changes_, 4);
  });
}

TEST_F(UpdaterTest, ABundleOfAStrangersKeyIsRefusedInRaucsWords) {
  RunBesideLoop([&] {
    FakeRauc rauc(bus_.address());
    rauc.refuses_signature = true;
    Start();
    WaitForRauc();
    const Change answer = Install("plumb-9.0.raucb");
    EXPECT_EQ(answer.result, ChangeResult::kInvalid);
    EXPECT_THAT(answer.message.English(), HasSubstr("signature verification failed"));
    EXPECT_EQ(StatusNow().failure.English(), answer.message.English());
    EXPECT_FALSE(StatusNow().restart_needed);
    EXPECT_EQ(rauc.installed(), "");
    EXPECT_FALSE(StatusNow().installing);
  });
}

TEST_F(UpdaterTest, AnOlderVersionIsRefused) {
  RunBesideLoop([&] {
    FakeRauc rauc(bus_.address());
    rauc.version = "0.0.9";
    Start();
    WaitForRauc();
    EXPECT_THAT(Install("plumb-9.0.raucb").message.English(), HasSubstr("older than 0.1.0"));
    EXPECT_EQ(rauc.installed(), "");
  });
}

TEST_F(UpdaterTest, AVersionThatCannotBeComparedIsRefused) {
  RunBesideLoop([&] {
    FakeRauc rauc(bus_.address());
    rauc.version = "9.0-rc1";
    Start();
    WaitForRauc();
    const Change answer = Install("plumb-9.0.raucb");
    EXPECT_EQ(answer.result, ChangeResult::kInvalid);
    EXPECT_THAT(answer.message.English(), HasSubstr("holds version '9.0-rc1': expected numbers"));
    EXPECT_EQ(rauc.installed(), "");
  });
}

TEST_F(UpdaterTest, AScanThatBeganWhileTheBundleWasLookedAtGoesFirst) {
  blocking_reason_ = "a scan is running";
  PlayWithRauc([&](FakeRauc& rauc) {
    const Change answer = Install("plumb-9.0.raucb");
    EXPECT_EQ(answer.result, ChangeResult::kConflict);
    EXPECT_EQ(answer.message.English(), blocking_reason_);
    EXPECT_EQ(rauc.installed(), "");
    EXPECT_FALSE(StatusNow().installing);
  });
}

TEST_F(UpdaterTest, AFailureInTheMiddleIsSaid) {
  RunBesideLoop([&] {
    FakeRauc rauc(bus_.address());
    rauc.fails = true;
    Start();
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    EXPECT_THAT(StatusNow().message.English(), HasSubstr("Failed writing to the slot"));
    EXPECT_EQ(Ended(), "plumb-9.0.raucb: Failed writing to the slot");
  });
}

TEST_F(UpdaterTest, ABusThatGoesAwayEndsTheInstallation) {
  PlayWithRauc([&](FakeRauc&) {
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    bus_.Stop();
    EXPECT_TRUE(Becomes([&] { return !Ended().empty(); }));
    EXPECT_THAT(Ended(), HasSubstr("broke"));
    EXPECT_FALSE(StatusNow().supported);
  });
}

/// Asks for a bundle without waiting for the answer.
class QuestionTest : public UpdaterTest {
 protected:
  void AskWhatIsSilent(const std::function<void(std::future<Change>&)>& then) {
    PlayWithRauc([&](FakeRauc& rauc) {
      rauc.is_silent = true;
      auto answer = std::make_shared<std::promise<Change>>();
      std::future<Change> future = answer->get_future();
      On([&] {
        updater_->Install("plumb-9.0.raucb",
                          [answer](const Change& change) { answer->set_value(change); });
      });
      ASSERT_TRUE(Becomes([&] { return rauc.num_asked > 0; }));
      EXPECT_EQ(future.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
      then(future);
      rauc.is_silent = false;
    });
  }
};

TEST_F(QuestionTest, ABusThatDiesInTheMiddleOfAQuestionIsAnAnswer) {
  AskWhatIsSilent([&](std::future<Change>& answer) {
    bus_.Stop();
    ASSERT_EQ(answer.wait_for(kPatience), std::future_status::ready);
    const Change change = answer.get();
    EXPECT_EQ(change.result, ChangeResult::kFailed);
    EXPECT_THAT(change.message.English(), HasSubstr("broke"));
    EXPECT_FALSE(StatusNow().installing);
    EXPECT_FALSE(StatusNow().supported);
  });
}

TEST_F(QuestionTest, AnInstallerThatNeverAnswersIsRefusedAfterItsTime) {
  answer_within_ = std::chrono::milliseconds(500);
  AskWhatIsSilent([&](std::future<Change>& answer) {
    ASSERT_EQ(answer.wait_for(kPatience), std::future_status::ready);
    EXPECT_NE(answer.get().result, ChangeResult::kDone);
    EXPECT_FALSE(StatusNow().installing) << "the next attempt can begin";
  });
}

TEST_F(UpdaterTest, ABusThatTakesCallersAndNeverSpeaksHoldsNothingUp) {
  const std::string path = (folder_ / "silent").string();
  const int silent = ListenUnix(path);
  bus_address_ = "unix:path=" + path;
  RunBesideLoop([&] {
    const auto begin = std::chrono::steady_clock::now();
    Start();
    EXPECT_FALSE(StatusNow().supported);
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kConflict);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10))
        << "25 s is what a bus has for its first words";
  });
  ::close(silent);
}

TEST_F(UpdaterTest, AnInstallerThatDiesInTheMiddleEndsTheInstallation) {
  RunBesideLoop([&] {
    auto rauc = std::make_unique<FakeRauc>(bus_.address());
    Start();
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
    rauc.reset();
    ASSERT_TRUE(Becomes([&] { return !Ended().empty(); }));
    EXPECT_THAT(Ended(), HasSubstr("the installer ended before it was done"));
    EXPECT_FALSE(StatusNow().installing);
    EXPECT_THAT(StatusNow().message.English(), HasSubstr("plumb-9.0.raucb was not installed"));
    rauc = std::make_unique<FakeRauc>(bus_.address());
    WaitForRauc();
    EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone) << "again, once it is back";
  });
}

TEST_F(UpdaterTest, OnlyBundlesOfTheFolderAreKnown) {
  RunBesideLoop([&] {
    FakeRauc rauc(bus_.address());
    WriteBundle(".hidden.raucb");
    WriteBundle("notes.txt");
    Start();
    WaitForRauc();
    for (const char* name : {"nothing.raucb", "../bus.conf", ".hidden.raucb", "notes.txt", ""}) {
      EXPECT_EQ(Install(name).result, ChangeResult::kNotFound) << name;
    }
  });
}

TEST_F(UpdaterTest, SentFilesBecomeBundlesOrAreRefused) {
  WriteBundle(".upload-left");
  PlayWithRauc([&](FakeRauc&) {
    EXPECT_FALSE(fs::exists(folder_ / "updates" / ".upload-left")) << "of a run before";
    const auto add = [&](const std::string& from, const std::string& name) {
      Change change;
      On([&] { change = updater_->Add(folder_ / "updates" / from, name); });
      return change;
    };
    WriteBundle(".upload-1");
    EXPECT_EQ(add(".upload-1", "b.raucb").result, ChangeResult::kDone);
    EXPECT_THAT(StatusNow().bundles, ::testing::ElementsAre("b.raucb", "plumb-9.0.raucb"));
    WriteBundle(".upload-2", "GIF8");
    const Change picture = add(".upload-2", "picture.raucb");
    EXPECT_EQ(picture.result, ChangeResult::kInvalid);
    EXPECT_EQ(picture.message.English(),
              "picture.raucb is not a bundle: expected a squashfs image");
    for (const char* name : {"c.raucb", "d.raucb", "e.raucb"}) {
      WriteBundle(".upload-3");
      EXPECT_EQ(add(".upload-3", name).result,
                std::string(name) == "e.raucb" ? ChangeResult::kConflict : ChangeResult::kDone)
          << name;
    }
    On([&] {
      EXPECT_EQ(updater_->Remove("c.raucb").result, ChangeResult::kDone);
      EXPECT_EQ(updater_->Remove("c.raucb").result, ChangeResult::kNotFound);
    });
    EXPECT_EQ(StatusNow().bundles.size(), 3U);
  });
}

TEST_F(UpdaterTest, ACopyIsRemovedAtTheEndHoweverItEndsAndAnUploadIsKept) {
  PlayWithRauc([&](FakeRauc& rauc) {
    const auto listed = [&] { return StatusNow().bundles; };
    for (const bool fails : {false, true}) {
      rauc.fails = fails;
      WriteBundle("copy.raucb");
      EXPECT_EQ(InstallCopy("copy.raucb").result, ChangeResult::kDone);
      EXPECT_THAT(listed(), ::testing::Contains("copy.raucb")) << "RAUC reads it";
      EXPECT_EQ(InstallCopy("copy.raucb").result, ChangeResult::kConflict);
      EXPECT_THAT(listed(), ::testing::Contains("copy.raucb")) << "the refusal is another's";
      rauc.Release();
      EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
      EXPECT_EQ(StatusNow().failure.empty(), !fails);
      EXPECT_THAT(listed(), ::testing::ElementsAre("plumb-9.0.raucb"));
      EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
      rauc.Release();
      EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
      EXPECT_THAT(listed(), ::testing::ElementsAre("plumb-9.0.raucb"));
    }
  });
}

TEST_F(UpdaterTest, ACopyThatIsRefusedIsRemovedAndAnUploadIsKept) {
  PlayWithRauc([&](FakeRauc& rauc) {
    const auto expect_refusal = [&](const char* which) {
      WriteBundle("copy.raucb");
      EXPECT_NE(InstallCopy("copy.raucb").result, ChangeResult::kDone) << which;
      EXPECT_NE(Install("plumb-9.0.raucb").result, ChangeResult::kDone) << which;
      EXPECT_THAT(StatusNow().bundles, ::testing::ElementsAre("plumb-9.0.raucb")) << which;
    };
    rauc.refuses_signature = true;
    expect_refusal("by the installer");
    rauc.refuses_signature = false;
    On([&] { blocking_reason_ = "a scan is running"; });
    expect_refusal("because of a scan");
  });
}

TEST_F(UpdaterTest, ACopyIsRemovedWhenTheBusGoesAway) {
  PlayWithRauc([&](FakeRauc&) {
    WriteBundle("copy.raucb");
    EXPECT_EQ(InstallCopy("copy.raucb").result, ChangeResult::kDone);
    bus_.Stop();
    EXPECT_TRUE(Becomes([&] { return !Ended().empty(); }));
    EXPECT_FALSE(fs::exists(folder_ / "updates" / "copy.raucb"));
    WriteBundle("copy.raucb");
    EXPECT_EQ(InstallCopy("copy.raucb").result, ChangeResult::kConflict) << "no installer";
    EXPECT_FALSE(fs::exists(folder_ / "updates" / "copy.raucb"));
  });
}

TEST_F(UpdaterTest, WhatIsNoBundleIsRefusedBeforeRaucIsAsked) {
  const auto why = [&](const std::string& name) {
    return WhyNoBundle(folder_ / "updates" / name, 1 << 20, name).English();
  };
  EXPECT_EQ(why("plumb-9.0.raucb"), "");
  WriteBundle("zip.raucb", "PK\x03\x04");
  EXPECT_THAT(why("zip.raucb"), HasSubstr("expected a squashfs"));
  WriteBundle("cut.raucb", "hsqs", 0);
  EXPECT_THAT(why("cut.raucb"), HasSubstr("no signature at its end"));
  WriteBundle("large.raucb", "hsqs", 0xFF, 2 << 20);
  EXPECT_THAT(why("large.raucb"), HasSubstr("too large: 2 MB, at most 1 MB"));
  WriteBundle("short.raucb", "hsqs", 0xFF, 10);
  EXPECT_THAT(why("short.raucb"), HasSubstr("too short"));
  fs::create_directory(folder_ / "updates" / "folder.raucb");
  EXPECT_THAT(why("folder.raucb"), HasSubstr("not a regular file"));
  fs::create_symlink("/etc/passwd", folder_ / "updates" / "link.raucb");
  EXPECT_THAT(why("link.raucb"), HasSubstr("cannot be read"));
}

}  // namespace
}  // namespace plumb
