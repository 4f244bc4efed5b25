// SPDX-License-Identifier: Apache-2.0
// The folder of plumb-dicomd as the appliance reads it, and today's list made of a worklist.
#include "daemon/received/received_files.hpp"

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <functional>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/planning/patient_hash.hpp"
#include "daemon/received/todays_list.hpp"
#include "drivers/dicom/find_content.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;

class ReceivedFilesTest : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directory(spool()); }

  [[nodiscard]] fs::path spool() const { return folder_ / "spool"; }
  [[nodiscard]] ReceivedFiles Files() const { return {spool(), folder_ / "received.json", key_}; }
  /// Reads one image at each call.
  [[nodiscard]] ReceivedFiles SlowFiles() const {
    return {spool(), folder_ / "received.json", key_, std::chrono::milliseconds(0)};
  }
  /// As plumb-dicomd keeps a file.
  void Keep(const std::string& name, const std::string& bytes,
            const std::string& class_uid = "1.2.840.10008.5.1.4.1.1.481.5") const {
    Written(spool() / (name + ".dcm"), bytes);
    std::ofstream(spool() / (name + ".json")) << fmt::format(
        R"({{"format":1,"received_at":"2026-03-01T09:30:00Z","calling_ae_title":"TPS",)"
        R"("address":"10.1.2.3","class_uid":"{}","instance_uid":"1.2","bytes":{}}})",
        class_uid, bytes.size());
  }
  void KeepSmallCt() const {
    const auto [structures, plan] = SmallCt();
    Keep("20260301-093000-0000000000000001", DicomBytes(structures));
    Keep("20260301-093001-0000000000000002", DicomBytes(plan));
  }

  testing::TempFolder folder_;
  const std::string key_ = std::string(kPatientKeyBytes, 'k');
};

TEST_F(ReceivedFilesTest, APlanIsJoinedWithItsStructureSetAndThePatientIsOnlyAHash) {
  KeepSmallCt();
  const auto listing = Files().List();
  ASSERT_EQ(listing.entries.size(), 2U);
  const auto& [plan, hash] = listing.entries[0];
  EXPECT_EQ(plan.kind, ReceivedKind::kPlan) << "the newest first";
  EXPECT_EQ(plan.structures, listing.entries[1].file.name);
  EXPECT_EQ(plan.sender, "TPS");
  EXPECT_EQ(plan.address, "10.1.2.3");
  EXPECT_EQ(plan.received_at, "2026-03-01T09:30:00Z");
  EXPECT_EQ(hash, PatientHash(key_, "SIM-1"));
  EXPECT_EQ(ReadTextFile(folder_ / "received.json", 1 << 20).find("SIM-1"), std::string::npos);
}

TEST_F(ReceivedFilesTest, WhatBecameOfThemOutlivesARestartAndEndsWithTheFile) {
  KeepSmallCt();
  const std::string plan = "20260301-093001-0000000000000002";
  Files().NoteReference({plan}, "7");
  EXPECT_EQ(Files().List().entries[0].file.kind, ReceivedKind::kPlan);
  EXPECT_EQ(Files().List().entries[0].file.reference_id, "7");
  fs::remove(spool() / (plan + ".dcm"));
  (void)Files().List();
  KeepSmallCt();
  EXPECT_EQ(Files().List().entries[0].file.reference_id, "") << "another file of that name";
}

TEST_F(ReceivedFilesTest, DamagedFilesNotesAndMemoryHideNothingElse) {
  KeepSmallCt();
  Keep("20260301-093002-0000000000000003", "no DICOM at all");
  const auto damaged = Files().List().entries;
  ASSERT_EQ(damaged.size(), 3U);
  EXPECT_FALSE(damaged[0].file.fault.empty());
  EXPECT_TRUE(damaged[1].file.fault.empty());
  for (const char* wrong : {"{", "[]", "{\"files\":{\"20260301-093002-0000000000000003\":7}}",
                            "{\"files\":{\"../x\":{}}}"}) {
    std::ofstream(folder_ / "received.json") << wrong;
    EXPECT_EQ(Files().List().entries.size(), 3U) << wrong;
    std::ofstream(spool() / "20260301-093001-0000000000000002.json") << wrong;
    const auto entries = Files().List().entries;
    ASSERT_EQ(entries.size(), 3U) << wrong;
    EXPECT_EQ(entries[1].file.kind, ReceivedKind::kPlan) << wrong;
    EXPECT_EQ(entries[1].file.sender, "") << wrong;
  }
}

/// Images of the small CT, as plumb-dicomd keeps them.
class ReceivedImagesTest : public ReceivedFilesTest {
 protected:
  static constexpr const char* kCt = "1.2.840.10008.5.1.4.1.1.2";
  static std::string NameOf(int number) {
    return fmt::format("20260301-0940{:02}-{:016x}", number, number);
  }
  /// The first is the oldest, and its instance has that number.
  void KeepImages(int from, const std::function<void(CtImage&)>& change = {}) const {
    std::vector<CtImage> images = SmallImages();
    for (std::size_t i = 0; i < images.size(); ++i) {
      if (change) change(images[i]);
      const std::string name = NameOf(from + static_cast<int>(i));
      Keep(name, DicomBytes(images[i]), kCt);
      std::ofstream(spool() / (name + ".json")) << fmt::format(
          R"({{"format":1,"received_at":"2026-03-01T09:40:{:02}Z","calling_ae_title":"TPS",)"
          R"("address":"10.1.2.3","class_uid":"{}","instance_uid":"1.2.{}"}})",
          i, kCt, images[i].series_uid + std::to_string(i));
    }
  }
  /// As if all that is there had come so long ago, or the files of that name.
  void SetAge(std::chrono::seconds age, const std::string& name = {}) const {
    const auto time = fs::file_time_type::clock::now() - age;
    for (const auto& entry : fs::directory_iterator(spool()))
      if (name.empty() || entry.path().stem() == name) fs::last_write_time(entry, time);
  }
  [[nodiscard]] static std::string WhyNot(ReceivedFiles& files, const std::string& series) {
    return files.ImagesOf(series).why_not.id();
  }

  /// Once everything is read.
  static ReceivedFiles::Listing Settled(ReceivedFiles& files) {
    ReceivedFiles::Listing listing = files.List();
    for (int i = 0; i < 100 && listing.unread > 0; ++i) listing = files.List();
    EXPECT_EQ(listing.unread, 0);
    return listing;
  }
};

TEST_F(ReceivedImagesTest, ImagesAreSortedIntoSeriesOfThePlansFrame) {
  KeepSmallCt();
  KeepImages(0);
  KeepImages(10, [](CtImage& image) {
    image.series_uid = "2.25.777";
    image.file.frame_of_reference_uid = "2.25.99";
    image.file.patient_id = "OTHER-1";
  });
  ReceivedFiles files = Files();
  const auto listing = Settled(files);
  const std::string series = SmallImages().front().series_uid;
  const int count = static_cast<int>(SmallImages().size());
  EXPECT_EQ(listing.images, 2 * count);
  ASSERT_EQ(listing.series.size(), 2U);
  EXPECT_EQ(listing.series[0].facts.uid, "2.25.777") << "the newest first";
  EXPECT_EQ(listing.series[0].patient_hash, PatientHash(key_, "OTHER-1"));
  EXPECT_EQ(listing.series[1].facts.uid, series);
  EXPECT_EQ(listing.series[1].facts.images, count);
  EXPECT_EQ(listing.series[1].facts.sender, "TPS");
  EXPECT_EQ(listing.series[1].facts.received_at, fmt::format("2026-03-01T09:40:{:02}Z", count - 1));
  EXPECT_EQ(listing.series[1].patient_hash, PatientHash(key_, "SIM-1"));
  ASSERT_EQ(listing.entries.size(), 2U);
  EXPECT_THAT(listing.entries[0].file.series, ::testing::ElementsAre(series));
  EXPECT_TRUE(listing.entries[0].file.has_skin);
  SetAge(ReceivedFiles::kSeriesPause);
  EXPECT_EQ(WhyNot(files, series), "");
  EXPECT_EQ(files.ImagesOf(series).files.size(), static_cast<std::size_t>(count));
  EXPECT_THROW((void)files.ImagesOf("2.25.404"), DataError);
  EXPECT_THROW((void)files.ImagesOf(""), DataError);
  EXPECT_EQ(ReadTextFile(folder_ / "received.json", 1 << 20).find("OTHER-1"), std::string::npos);
}

TEST_F(ReceivedImagesTest, OfAnInstanceThatWasSentTwiceTheNewestCounts) {
  KeepImages(0);
  KeepImages(20);
  ReceivedFiles files = Files();
  const auto listing = Settled(files);
  ASSERT_EQ(listing.series.size(), 1U);
  const auto images = files.ImagesOf(listing.series[0].facts.uid).files;
  EXPECT_EQ(static_cast<int>(images.size()), listing.series[0].facts.images);
  EXPECT_EQ(images.size(), SmallImages().size());
  for (const fs::path& image : images) EXPECT_GE(image.stem().string(), NameOf(20));
}

TEST_F(ReceivedImagesTest, ASeriesIsWholeAMinuteAfterItsNewestImage) {
  KeepImages(0);
  ReceivedFiles files = Files();
  const std::string series = Settled(files).series.at(0).facts.uid;
  const std::string newest = NameOf(static_cast<int>(SmallImages().size()) - 1);
  SetAge(ReceivedFiles::kSeriesPause);
  EXPECT_EQ(WhyNot(files, series), "");
  SetAge(std::chrono::seconds(0), newest);
  EXPECT_EQ(WhyNot(files, series), "scan.images_arriving");
  SetAge(ReceivedFiles::kSeriesPause / 2, newest);
  EXPECT_EQ(WhyNot(files, series), "scan.images_arriving");
  SetAge(-2 * ReceivedFiles::kSeriesPause, newest);
  EXPECT_EQ(WhyNot(files, series), "") << "the clock was set back";
}

TEST_F(ReceivedImagesTest, ImagesThatCameLaterDoNotHoldUpASeriesThatIsThere) {
  KeepImages(0);
  ReceivedFiles first = Files();
  const std::string series = Settled(first).series.at(0).facts.uid;
  SetAge(3 * ReceivedFiles::kSeriesPause);
  const auto of_other = [](CtImage& image) { image.series_uid = "2.25.777"; };
  KeepImages(20, of_other);
  ReceivedFiles files = SlowFiles();
  EXPECT_EQ(WhyNot(files, series), "");
  EXPECT_EQ(files.ImagesOf("2.25.777").files.back().stem().string(), NameOf(20))
      << "the oldest is read first";
  EXPECT_GT(files.List().unread, 1);
  SetAge(3 * ReceivedFiles::kSeriesPause);
  EXPECT_EQ(WhyNot(files, series), "scan.images_being_read") << "they may be of this series";
  (void)Settled(files);
  EXPECT_EQ(WhyNot(files, series), "");
}

TEST_F(ReceivedImagesTest, MoreImagesThanAreLookedAtAreCountedAndNoneIsImported) {
  const auto keep = [&](std::size_t number) {
    const std::string name = fmt::format("20260301-093000-{:016x}", number);
    std::ofstream(spool() / (name + ".dcm")) << "x";
    std::ofstream(spool() / (name + ".json")) << fmt::format(R"({{"class_uid":"{}"}})", kCt);
    return name;
  };
  for (std::size_t i = 0; i < ReceivedImages::kMost; ++i) (void)keep(i);
  ReceivedFiles files = SlowFiles();
  EXPECT_EQ(WhyNot(files, "2.25.777"), "scan.images_being_read");
  EXPECT_EQ(files.List().unlisted, 0);
  const std::string beyond = keep(ReceivedImages::kMost);
  EXPECT_EQ(WhyNot(files, "2.25.777"), "scan.images_too_many");
  const auto listing = files.List();
  EXPECT_EQ(listing.images, static_cast<int>(ReceivedImages::kMost) + 1);
  EXPECT_EQ(listing.unlisted, 1);
  fs::remove(spool() / (beyond + ".dcm"));
  EXPECT_EQ(WhyNot(files, "2.25.777"), "scan.images_being_read");
}

TEST_F(ReceivedImagesTest, EachIsReadOnceAndDamagedOnesAreCountedWithTheirFault) {
  KeepImages(0);
  Keep(NameOf(50), "an image", kCt);
  {
    ReceivedFiles files = Files();
    const auto listing = Settled(files);
    EXPECT_EQ(listing.damaged_images, 1);
    EXPECT_FALSE(listing.image_fault.empty());
    EXPECT_EQ(listing.series.at(0).facts.images, static_cast<int>(SmallImages().size()));
  }
  // What was read is known without reading: the files may say anything now.
  for (std::size_t i = 0; i < SmallImages().size(); ++i)
    Written(spool() / (NameOf(static_cast<int>(i)) + ".dcm"), "x");
  ReceivedFiles again = Files();
  const auto kept = again.List();
  EXPECT_EQ(kept.unread, 0);
  EXPECT_EQ(kept.damaged_images, 1);
  EXPECT_EQ(kept.series.at(0).facts.images, static_cast<int>(SmallImages().size()));
  fs::remove(spool() / (NameOf(50) + ".dcm"));
  EXPECT_EQ(again.List().damaged_images, 0);
  EXPECT_TRUE(again.List().image_fault.empty());
  // Damaged notes are discarded, and every file is read again.
  for (const char* wrong : {R"({"files":{},"images":7})", R"({"files":{},"images":{"series":{}}})",
                            R"({"files":{},"images":{"series":{},"names":{"a":3}}})"}) {
    std::ofstream(folder_ / "received.json") << wrong;
    ReceivedFiles files = Files();
    EXPECT_EQ(Settled(files).damaged_images, static_cast<int>(SmallImages().size())) << wrong;
  }
}

/// So few file descriptors are left that a folder can be listed, and no program started.
class FewDescriptors {
 public:
  FewDescriptors() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const int free = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    ::close(free);
    const rlimit few{.rlim_cur = static_cast<rlim_t>(free) + 1, .rlim_max = before_.rlim_max};
    ::setrlimit(RLIMIT_NOFILE, &few);
  }
  FewDescriptors(const FewDescriptors&) = delete;
  FewDescriptors& operator=(const FewDescriptors&) = delete;
  ~FewDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_{};
};

TEST_F(ReceivedFilesTest, AFileWhoseReaderCannotBeStartedIsReadLater) {
  KeepSmallCt();
  ReceivedFiles files = Files();
  {
    const FewDescriptors few;
    EXPECT_THROW((void)files.List(), IoError);
  }
  const auto entries = files.List().entries;
  EXPECT_EQ(entries.at(0).file.kind, ReceivedKind::kPlan);
  EXPECT_EQ(entries.at(1).file.kind, ReceivedKind::kStructures);
}

TEST_F(ReceivedImagesTest, AnImageWhoseReaderCannotBeStartedIsReadLater) {
  KeepImages(0);
  ReceivedFiles files = Files();
  {
    const FewDescriptors few;
    EXPECT_THROW((void)files.List(), IoError);
  }
  const auto listing = Settled(files);
  EXPECT_EQ(listing.damaged_images, 0);
  EXPECT_EQ(listing.series.at(0).facts.images, static_cast<int>(SmallImages().size()));
}

TEST_F(ReceivedFilesTest, WithoutAnExternalContourThatIsSaidOfThePlan) {
  const auto [structures, plan] = SmallCt({.quirks = {simulated::CtQuirk::kNoExternal}});
  Keep("20260301-093000-0000000000000001", DicomBytes(structures));
  Keep("20260301-093001-0000000000000002", DicomBytes(plan));
  const auto entries = Files().List().entries;
  EXPECT_FALSE(entries.at(0).file.has_skin);
  EXPECT_FALSE(entries.at(1).file.has_skin);
}

TEST_F(ReceivedFilesTest, WhatAnEarlierVersionReadIsReadAgainAndWhatBecameOfItStays) {
  KeepSmallCt();
  const std::string plan = "20260301-093001-0000000000000002";
  std::ofstream(folder_ / "received.json") << fmt::format(
      R"({{"format":1,"files":{{"{}":{{"kind":"plan","instance_uid":"","structure_set_uid":"",)"
      R"("label":"","patient_hash":"","reference_id":"7","fault":null,"fault_english":""}}}}}})",
      plan);
  const auto entries = Files().List().entries;
  EXPECT_EQ(entries.at(0).file.reference_id, "7");
  EXPECT_TRUE(entries.at(0).file.has_skin);
}

TEST_F(ReceivedFilesTest, ImagesAreCountedAndOnlyNamesOfOursAreOpened) {
  Keep("20260301-093000-0000000000000001", "an image", "1.2.840.10008.5.1.4.1.1.2");
  Written(spool() / "a foreign name.dcm", "x");
  ReceivedFiles files = Files();
  EXPECT_EQ(files.List().images, 1);
  EXPECT_TRUE(files.List().entries.empty());
  EXPECT_NO_THROW((void)files.PathOf("20260301-093000-0000000000000001"));
  for (const char* name :
       {"", "../received", "a foreign name", "20260301-093000-000000000000000f", "/etc/passwd"})
    EXPECT_THROW((void)files.PathOf(name), DataError) << name;
}

TEST_F(ReceivedFilesTest, EightAreReadAtOnceAndAHundredAreListed) {
  for (int i = 0; i < 101; ++i) Keep(fmt::format("20260301-093000-{:016x}", i), "no DICOM");
  ReceivedFiles files = Files();
  const auto count_read = [&] {
    const auto entries = files.List().entries;
    return std::ranges::count_if(entries, [](const auto& one) { return one.file.is_read; });
  };
  EXPECT_EQ(count_read(), 8);
  EXPECT_EQ(count_read(), 16);
  EXPECT_EQ(files.List().entries.size(), 100U);
  EXPECT_EQ(files.List().unlisted, 1);
}

TEST_F(ReceivedFilesTest, WithoutTheFolderTheReasonIsSaid) {
  fs::remove_all(spool());
  ReceivedFiles files = Files();
  EXPECT_THROW((void)files.List(), IoError);
}

TEST(TodaysListTest, OnlyKnownPatientsAreNamedInTheOrderOfTheDay) {
  const std::string key(kPatientKeyBytes, 'k');
  const PlannedPatients known = {{PatientHash(key, "A"), {"1", "CT-1"}},
                                 {PatientHash(key, "B"), {"2", "CT-2"}}};
  const TodaysWorklist list = ListToday(
      {{"A", "1015"}, {"B ", "0930"}, {"C", "0800"}, {"", "0700"}, {"A", "x"}}, key, known);
  ASSERT_EQ(list.patients.size(), 3U);
  EXPECT_EQ(list.patients[0].time, "");
  EXPECT_EQ(list.patients[1].patient_code, "CT-2");
  EXPECT_EQ(list.patients[1].time, "09:30");
  EXPECT_EQ(list.patients[2].patient_id, "1");
  EXPECT_EQ(list.unknown, 2);
  EXPECT_EQ(ListToday({{"A", "1015"}}, std::string(kPatientKeyBytes, 'j'), known).unknown, 1)
      << "another unit's key";
}

TEST(FindContentTest, RequestAndAnswerAreReadAsTheyWereWritten) {
  const WorklistRequest request{.peer = {.ae_title = "RIS", .host = "10.0.0.1", .port = 104},
                                .own_ae_title = "PLUMB",
                                .station_ae_title = "LINAC1",
                                .date = "20260301",
                                .tls = {.certificate = "a", .key = "b", .trusted = "c"}};
  const WorklistRequest read = ParseWorklistRequest(WorklistRequestText(request));
  EXPECT_EQ(read.peer.port, 104);
  EXPECT_EQ(read.station_ae_title, "LINAC1");
  EXPECT_EQ(read.date, "20260301");
  EXPECT_EQ(read.tls.trusted, "c");
  const auto steps = ParseWorklist(WorklistText({{"A\"\n", "0930"}, {"", ""}}));
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[0].patient_id, "A\"\n");
  for (const char* wrong : {"", "{}", "[1]", "[{\"patient_id\": 1, \"time\": \"\"}]", "[{}]"})
    EXPECT_THROW((void)ParseWorklist(wrong), DataError) << wrong;
  EXPECT_THROW((void)ParseWorklistRequest("[]"), DataError);
}

}  // namespace
}  // namespace plumb
