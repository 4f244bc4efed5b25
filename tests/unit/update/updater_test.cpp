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
#include "words/update.hpp"
#include "words/upkeep.hpp"

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
    EXPECT_EQ(Install("plumb-9.0.raucb").message, say::update::Older("0.0.9", "0.1.0"))
        << "with its id and its arguments, or nobody can translate it";
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
      return Add(folder_ / "updates" / from, name);
    };
    WriteBundle(".upload-1");
    EXPECT_EQ(add(".upload-1", "b.raucb").result, ChangeResult::kDone);
    EXPECT_THAT(StatusNow().bundles, ::testing::ElementsAre("b.raucb", "plumb-9.0.raucb"));
    WriteBundle(".upload-2", "GIF8");
    const Change picture = add(".upload-2", "picture.raucb");
    EXPECT_EQ(picture.result, ChangeResult::kInvalid);
    EXPECT_EQ(picture.message, say::update::NoSquashfs("picture.raucb"));
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

/// A copy of a stick, among four bundles that somebody uploaded, one of them of its name.
class CopyTest : public UpdaterTest {
 protected:
  CopyTest() {
    for (const char* name : {"a.raucb", "b.raucb", "c.raucb"}) WriteBundle(name);
  }
  Change InstallNewCopy() {
    WriteBundle(kCopy);
    return InstallCopy(copy_, "plumb-9.0.raucb");
  }
  void ExpectOnlyUploads(const std::string& when) {
    EXPECT_FALSE(fs::exists(copy_)) << when;
    EXPECT_THAT(StatusNow().bundles,
                ::testing::ElementsAre("a.raucb", "b.raucb", "c.raucb", "plumb-9.0.raucb"))
        << when;
  }
  static constexpr const char* kCopy = ".upload-copy.raucb";
  const fs::path copy_ = folder_ / "updates" / kCopy;
};

TEST_F(CopyTest, IsRemovedAtTheEndHoweverItEndsAndAnUploadOfItsNameIsKept) {
  PlayWithRauc([&](FakeRauc& rauc) {
    for (const bool fails : {false, true}) {
      rauc.fails = fails;
      EXPECT_EQ(InstallNewCopy().result, ChangeResult::kDone);
      EXPECT_EQ(rauc.installed(), copy_.string());
      EXPECT_TRUE(fs::exists(copy_)) << "RAUC reads it";
      WriteBundle(".upload-other.raucb");
      EXPECT_EQ(InstallCopy(folder_ / "updates" / ".upload-other.raucb", "x").message,
                say::update::InstallingThis("plumb-9.0.raucb"));
      EXPECT_TRUE(fs::exists(copy_)) << "the refusal is another's";
      rauc.Release();
      EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
      EXPECT_EQ(StatusNow().failure.empty(), !fails);
      ExpectOnlyUploads(fails ? "failed" : "installed");
      EXPECT_EQ(Install("plumb-9.0.raucb").result, ChangeResult::kDone);
      rauc.Release();
      EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
      ExpectOnlyUploads("an upload was installed");
    }
  });
}

TEST_F(CopyTest, ThatIsRefusedIsRemovedAndAnUploadIsKept) {
  PlayWithRauc([&](FakeRauc& rauc) {
    const auto expect_refusal = [&](const char* which) {
      EXPECT_NE(InstallNewCopy().result, ChangeResult::kDone) << which;
      EXPECT_NE(Install("plumb-9.0.raucb").result, ChangeResult::kDone) << which;
      ExpectOnlyUploads(which);
    };
    rauc.refuses_signature = true;
    expect_refusal("by the installer");
    rauc.refuses_signature = false;
    On([&] { blocking_reason_ = "a scan is running"; });
    expect_refusal("because of a scan");
  });
}

TEST_F(CopyTest, IsRemovedWhenTheBusGoesAway) {
  PlayWithRauc([&](FakeRauc&) {
    EXPECT_EQ(InstallNewCopy().result, ChangeResult::kDone);
    bus_.Stop();
    EXPECT_TRUE(Becomes([&] { return !Ended().empty(); }));
    EXPECT_FALSE(fs::exists(copy_));
    EXPECT_EQ(InstallNewCopy().result, ChangeResult::kConflict) << "no installer";
    EXPECT_FALSE(fs::exists(copy_));
  });
}

/// Work beside the loop begins when the test lets it, or is refused.
TEST_F(UpdaterTest, TheLoopNeitherReadsNorStoresABundle) {
  std::vector<std::function<void()>> waiting;
  bool is_busy = false;
  run_in_background_ = [&](std::function<void()> work) {
    if (!is_busy) waiting.push_back(std::move(work));
    return !is_busy;
  };
  PlayWithRauc([&](FakeRauc& rauc) {
    WriteBundle(".upload-1");
    std::vector<Change> answers;
    const auto take = [&](const Change& change) { answers.push_back(change); };
    const auto run_next = [&] {
      std::function<void()> work;
      On([&] {
        work = waiting.at(0);
        waiting.erase(waiting.begin());
      });
      work();
    };
    On([&] { updater_->Add(folder_ / "updates" / ".upload-1", "b.raucb", take); });
    EXPECT_FALSE(fs::exists(folder_ / "updates" / "b.raucb"));
    run_next();
    EXPECT_TRUE(fs::exists(folder_ / "updates" / "b.raucb"));
    On([&] { updater_->Install("b.raucb", take); });
    EXPECT_EQ(rauc.num_asked, 0);
    run_next();
    EXPECT_TRUE(Becomes([&] {
      bool has_answer = false;
      On([&] { has_answer = answers.size() == 2; });
      return has_answer;
    }));
    On([&] {
      EXPECT_EQ(answers[0].result, ChangeResult::kDone);
      EXPECT_EQ(answers[1].result, ChangeResult::kDone);
    });
    rauc.Release();
    EXPECT_TRUE(Becomes([&] { return !StatusNow().installing; }));
    is_busy = true;
    EXPECT_EQ(Install("b.raucb").message, say::upkeep::DiskBusy());
    EXPECT_FALSE(StatusNow().installing);
    WriteBundle(".upload-2");
    EXPECT_EQ(Add(folder_ / "updates" / ".upload-2", "c.raucb").message, say::upkeep::DiskBusy());
    is_busy = false;
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
