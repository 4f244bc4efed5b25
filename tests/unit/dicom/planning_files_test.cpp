// SPDX-License-Identifier: Apache-2.0
// Files through the reader in its own process. They come from a writer that knows no DCMTK.
#include "drivers/dicom/planning_files.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <stop_token>

#include "algo/base/errors.hpp"
#include "daemon/planning/planning_import.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/dicom/small_files.hpp"
#include "words/dicom.hpp"
#include "words/scan.hpp"

namespace plumb {
namespace {

using simulated::CtQuirk;

class PlanningFilesTest : public ::testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name, const std::string& bytes) const {
    return Written(folder_.path() / name, bytes);
  }
  // The message with which a file is refused; empty if it is not.
  static Message Refusal(const std::filesystem::path& file) {
    try {
      (void)ReadDicomFile(file);
    } catch (const DataError& error) {
      return error.message();
    }
    return {};
  }

  testing::TempFolder folder_;
};

TEST_F(PlanningFilesTest, AStructureSetIsReadAsItWasWritten) {
  auto [written, plan] = SmallCt({.quirks = {CtQuirk::kPoints, CtQuirk::kEmptyRoi}});
  written.rois[1].name = "K\u00f6rper";
  written.image_uids = {{"2.25.2", {"2.25.481.2.1", "2.25.481.2.2"}}, {"2.25.3", {"2.25.481.2.3"}}};
  const StructureSet read = ReadStructureSet(Write("structures.dcm", DicomBytes(written)));
  EXPECT_EQ(read.file.instance_uid, written.file.instance_uid);
  EXPECT_EQ(read.file.patient_id, "SIM-1");
  EXPECT_EQ(read.file.date, "20260101 080000");
  EXPECT_EQ(read.file.frame_of_reference_uid, "2.25.52");
  EXPECT_EQ(read.image_uids, written.image_uids);
  StructureSet unnamed = written;
  unnamed.image_uids["2.25.3"].push_back("");
  unnamed.image_uids[""] = {"2.25.481.2.4"};
  EXPECT_EQ(ReadStructureSet(Write("unnamed.dcm", DicomBytes(unnamed))).image_uids,
            written.image_uids)
      << "items without an identifier name nothing";
  ASSERT_EQ(read.rois.size(), written.rois.size());
  for (std::size_t r = 0; r < read.rois.size(); ++r) {
    const PlannedRoi &a = read.rois[r], &b = written.rois[r];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.type, b.type);
    ASSERT_EQ(a.contours.size(), b.contours.size()) << a.name;
    for (std::size_t c = 0; c < a.contours.size(); ++c) {
      EXPECT_EQ(a.contours[c].kind, b.contours[c].kind);
      EXPECT_EQ(a.contours[c].stated_points, b.contours[c].stated_points);
      ASSERT_EQ(a.contours[c].points_mm.size(), b.contours[c].points_mm.size());
      for (std::size_t i = 0; i < a.contours[c].points_mm.size(); ++i)
        EXPECT_LT((a.contours[c].points_mm[i] - b.contours[c].points_mm[i]).norm(), 1e-3);
    }
  }
}

TEST_F(PlanningFilesTest, APlanIsReadAsItWasWritten) {
  auto [structures, written] = SmallCt({.posture = PatientPosture::kFeetFirstProne});
  written.setups[0].has_displacement = true;
  written.beams[1].pitch_deg = 1.5;
  const TreatmentPlan read = ReadTreatmentPlan(Write("plan.dcm", DicomBytes(written)));
  EXPECT_EQ(read.geometry, "PATIENT");
  EXPECT_EQ(read.approval, "APPROVED");
  EXPECT_EQ(read.structure_set_uid, structures.file.instance_uid);
  ASSERT_EQ(read.setups.size(), 1U);
  EXPECT_EQ(read.setups[0].position, "FFP");
  EXPECT_TRUE(read.setups[0].has_displacement);
  ASSERT_EQ(read.beams.size(), 2U);
  EXPECT_EQ(read.beams[1].name, "LAT");
  EXPECT_EQ(read.beams[1].setup, 1);
  EXPECT_NEAR(read.beams[1].couch_deg, 8.4737e-10, 1e-14) << "with an exponent";
  EXPECT_FLOAT_EQ(static_cast<float>(read.beams[1].pitch_deg), 1.5F) << "a binary float";
  EXPECT_LT((*read.beams[0].isocentre_mm - *written.beams[0].isocentre_mm).norm(), 1e-3);
}

TEST_F(PlanningFilesTest, ContourDataThatStandAsUnknownAreRead) {
  const auto [written, plan] = SmallCt({.quirks = {CtQuirk::kDense}});
  const std::string bytes = DicomBytes(written);
  ASSERT_NE(bytes.find(std::string("\x06\x30\x50\x00UN", 6)), std::string::npos);
  const StructureSet read = ReadStructureSet(Write("structures.dcm", bytes));
  ASSERT_GT(written.rois[0].contours[0].points_mm.size(), 3000U);
  EXPECT_EQ(read.rois[0].contours[0].points_mm.size(),
            written.rois[0].contours[0].points_mm.size());
}

TEST_F(PlanningFilesTest, NamesInLatin1AreRead) {
  auto [written, plan] = SmallCt();
  written.rois[0].name = "K\xF6rper";
  std::string bytes = DicomBytes(written);
  bytes.replace(bytes.find("ISO_IR 192"), 10, "ISO_IR 100");
  EXPECT_EQ(ReadStructureSet(Write("structures.dcm", bytes)).rois[0].name, "K\u00f6rper");
}

TEST_F(PlanningFilesTest, NamesWithInvisibleCharactersShowThem) {
  auto [written, plan] = SmallCt();
  written.rois[0].name = "BO\u202EDY\u200B";
  EXPECT_EQ(ReadStructureSet(Write("structures.dcm", DicomBytes(written))).rois[0].name,
            "BO\uFFFDDY\uFFFD");
}

TEST_F(PlanningFilesTest, OtherFilesAreRefusedWithTheirKind) {
  const auto [structures, plan] = SmallCt();
  const auto s = Write("structures.dcm", DicomBytes(structures));
  const auto p = Write("plan.dcm", DicomBytes(plan));
  EXPECT_TRUE(IsDicomFile(s));
  EXPECT_THROW((void)ReadStructureSet(p), DataError);
  EXPECT_THROW((void)ReadTreatmentPlan(s), DataError);
  EXPECT_EQ(ReadDicomFile(p).modality, "RTPLAN");
  EXPECT_TRUE(Refusal(folder_.path() / "none.dcm").Is(say::dicom::kNoFile));
  EXPECT_TRUE(Refusal(folder_.path()).Is(say::dicom::kDamaged));
  EXPECT_FALSE(IsDicomFile(folder_.path()));
  EXPECT_FALSE(IsDicomFile(Write("text", std::string(200, 'a'))));
  EXPECT_TRUE(Refusal(Write("text", std::string(2000, 'a'))).Is(say::dicom::kDamaged));
  EXPECT_TRUE(Refusal(Write("empty", "")).Is(say::dicom::kDamaged));
}

TEST_F(PlanningFilesTest, AnImageIsReadAsItWasWritten) {
  const CtImage written = SmallImages({.posture = PatientPosture::kFeetFirstProne})[3];
  const PlanningContent content = ReadDicomFile(Write("image.dcm", DicomBytes(written)));
  EXPECT_EQ(content.modality, "CT");
  ASSERT_TRUE(content.image);
  const CtImage& read = *content.image;
  EXPECT_EQ(read.file.patient_id, "SIM-1");
  EXPECT_EQ(read.file.frame_of_reference_uid, "2.25.52");
  EXPECT_EQ(read.series_uid, written.series_uid);
  EXPECT_EQ(read.position, "FFP");
  ASSERT_EQ(read.rows, written.rows);
  ASSERT_EQ(read.columns, written.columns);
  EXPECT_NE(read.rows, read.columns);
  EXPECT_LT((read.origin_mm - written.origin_mm).norm(), 1e-3);
  EXPECT_LT((read.along_row - written.along_row).norm(), 1e-9);
  EXPECT_LT((read.along_column - written.along_column).norm(), 1e-9);
  EXPECT_DOUBLE_EQ(read.row_spacing_mm, 5.0);
  ASSERT_EQ(read.hu.size(), written.hu.size());
  for (std::size_t i = 0; i < read.hu.size(); ++i)
    ASSERT_NEAR(read.hu[i], std::max(-1024.0F, written.hu[i]), 0.51);
}

using namespace std::string_literals;

std::string Word(int value) {
  return {static_cast<char>(value & 0xFF), static_cast<char>(value >> 8)};
}

// The tag of group 28, from which on a change counts its bytes.
std::string Tag28(int element) { return "\x28\0"s + Word(element); }

std::string Changed(std::string bytes, const std::string& tag, std::size_t at,
                    const std::string& value) {
  const std::size_t found = bytes.find(tag);
  EXPECT_NE(found, std::string::npos) << tag;
  return bytes.replace(found + at, value.size(), value);
}

TEST_F(PlanningFilesTest, PixelsAreSignedAndScaledAsTheFileSays) {
  const CtImage image = SmallImages().front();
  std::string bytes = DicomBytes(image);
  bytes.replace(bytes.size() - 4, 4, Word(0xFFF) + Word(0x7FF));  // the last two pixels
  const auto last_two = [&](const std::string& changed) {
    const auto read = ReadDicomFile(Write("i.dcm", changed)).image;
    EXPECT_TRUE(read);
    return read ? std::vector(read->hu.end() - 2, read->hu.end()) : std::vector<float>();
  };
  EXPECT_THAT(last_two(bytes), ::testing::ElementsAre(4095 - 1024, 2047 - 1024));
  const std::string is_signed = Changed(bytes, Tag28(0x103) + "US", 8, Word(1));
  EXPECT_THAT(last_two(is_signed), ::testing::ElementsAre(-1 - 1024, 2047 - 1024));
  EXPECT_THAT(last_two(Changed(bytes, Tag28(0x1053), 8, "2 ")),
              ::testing::ElementsAre(2 * 4095 - 1024, 2 * 2047 - 1024));
  // A padding value, signed as the pixels are, stands for pixels without a measurement.
  for (const auto& [of, type] : {std::pair(bytes, "US"s), std::pair(is_signed, "SS"s)}) {
    std::string padded = of;
    padded.insert(padded.find(Tag28(0x1052)), Tag28(0x120) + type + Word(2) + Word(0xFFF));
    EXPECT_THAT(last_two(padded), ::testing::ElementsAre(kNothing_hu, 2047 - 1024)) << type;
  }
}

// Each by one value of the file, with that value as the cause.
TEST_F(PlanningFilesTest, ImagesThatCannotBeUsedAreRefusedWithTheCause) {
  const CtImage image = SmallImages().front();
  const std::string bytes = DicomBytes(image);
  namespace d = say::dicom;
  const auto refused = [&](const std::string& changed, const MessageId& why,
                           const std::string& in_words) {
    const auto file = Write("i.dcm", changed);
    EXPECT_THROW(ForEachCtImage({file}, [](const CtImage&, const std::string&) {}), DataError);
    const PlanningContent described = ReadDicomFile(file);  // all the same
    EXPECT_EQ(described.modality, "CT");
    EXPECT_EQ(described.file.frame_of_reference_uid, "2.25.52");
    EXPECT_TRUE(described.image_fault.Is(why)) << described.image_fault.English();
    EXPECT_THAT(described.image_fault.English(), ::testing::HasSubstr(in_words));
  };
  const auto word = [&](int element, int value) {
    return Changed(bytes, Tag28(element) + "US", 8, Word(value));
  };
  // In the place of an element another one of its group, which says nothing.
  const auto without = [&](const std::string& tag) { return Changed(bytes, tag, 2, Word(0x1FF)); };
  refused(word(0x100, 8), d::kImageFormat, "(0028,0100) is 8");
  refused(word(0x102, 15), d::kImageFormat, "(0028,0102) is 15");
  refused(word(0x02, 3), d::kImageFormat, "(0028,0002) is 3");
  refused(word(0x10, 4000), d::kImageSize, "x4000 pixels");
  refused(word(0x10, image.rows + 1), d::kImageCut, "pixels");
  refused(Changed(bytes, Tag28(0x1053), 8, "0 "), d::kImageScale, "(0028,1053) is \"0\"");
  refused(without(Tag28(0x1053)), d::kMissing, "(0028,1053)");
  refused(without(Tag28(0x1052)), d::kMissing, "(0028,1052)");
  refused(without(Tag28(0x30)), d::kMissing, "(0028,0030)");
  refused(without("\x20\0\x32\0"s), d::kMissing, "(0020,0032)");
  refused(without("\x20\0\x37\0"s), d::kMissing, "(0020,0037)");
  std::string frames = bytes;
  frames.insert(frames.find(Tag28(0x10)), Tag28(0x08) + "IS" + Word(2) + "2 ");
  refused(frames, d::kImageFormat, "(0028,0008) is 2");
  for (const std::string& damaged :
       {bytes.substr(0, bytes.size() - 400),
        Changed(bytes, "1.2.840.10008.1.2.1\0"s, 0, "1.2.840.10008.1.2.5\0"s)}) {  // RLE
    const auto file = Write("i.dcm", damaged);
    EXPECT_THROW(ForEachCtImage({file}, [](const CtImage&, const std::string&) {}), DataError);
  }
}

TEST_F(PlanningFilesTest, ImagesAreFoundInFoldersBesideTheirPlan) {
  const auto [structures, plan] = SmallCt();
  const auto folder = folder_.path() / "ct";
  std::filesystem::create_directory(folder);
  const std::vector<CtImage> images = SmallImages();
  for (std::size_t i = 0; i < images.size(); ++i)
    Written(folder / (std::to_string(100 + i) + ".dcm"), DicomBytes(images[i]));
  Written(folder / "plan.dcm", DicomBytes(plan));
  Written(folder / "structures.dcm", DicomBytes(structures));
  Written(folder / "notes.txt", "nothing of DICOM");
  std::vector<double> places;
  const auto visit = [&](const CtImage& image, const std::string&) {
    places.push_back(image.origin_mm.z());
  };
  ForEachCtImage({folder}, visit);
  ASSERT_EQ(places.size(), images.size());
  EXPECT_NEAR(places.back(), images.back().origin_mm.z(), 1e-3);
  // A file that is named must be an image, and of other images none is left out silently.
  EXPECT_THROW(ForEachCtImage({folder / "plan.dcm"}, visit), DataError);
  std::string mr = DicomBytes(images.front());
  mr.replace(mr.rfind("1.2.840.10008.5.1.4.1.1.2"), 25, "1.2.840.10008.5.1.4.1.1.4");
  Written(folder / "mr.dcm", mr);
  EXPECT_THROW(ForEachCtImage({folder}, visit), DataError);
  const auto empty = folder_.path() / "empty";
  std::filesystem::create_directory(empty);
  EXPECT_THROW(ForEachCtImage({empty}, visit), DataError);
}

TEST_F(PlanningFilesTest, AStopRequestEndsTheReadingOfImages) {
  const auto plan = Write("plan.dcm", DicomBytes(SmallCt().second));
  std::vector<std::filesystem::path> files;
  for (const CtImage& image : SmallImages())
    files.push_back(Write(std::to_string(files.size()), DicomBytes(image)));
  std::stop_source stop;
  std::size_t num_read = 0;
  const auto read = [&] {
    const auto after_one = [&](std::size_t count) {
      num_read = count;
      stop.request_stop();
    };
    return ReadPlanningWithImages({.structures = {}, .plan = plan},
                                  ImagesIn(files, -300, stop.get_token(), after_one), {});
  };
  EXPECT_THROW((void)read(), Interrupted);
  EXPECT_EQ(num_read, 1U);
}

TEST_F(PlanningFilesTest, WithinTimeEndsAtItsLimitAndOnAStopRequest) {
  int visits = 0;
  const auto count = [&](const CtImage&, const std::string&) { ++visits; };
  std::stop_source stop;
  const CtImageVisit in_time = WithinTime(std::chrono::hours(1), stop.get_token(), count);
  in_time({}, "");
  EXPECT_THROW(WithinTime(std::chrono::seconds(0), stop.get_token(), count)({}, ""), DataError);
  stop.request_stop();
  EXPECT_THROW(in_time({}, ""), Interrupted);
  EXPECT_EQ(visits, 1);
}

/// An upload of plan and images, as a browser puts it together.
class SentImagesTest : public PlanningFilesTest {
 protected:
  static std::string Size(std::uint64_t bytes) {
    std::string text;
    for (int i = 0; i < 8; ++i) text += static_cast<char>(bytes >> (8 * i) & 0xFFU);
    return text;
  }
  [[nodiscard]] std::filesystem::path Upload(const std::string& images) const {
    return Write("sent", "structures" + plan_ + images);
  }
  /// Numbers in the names of the images.
  [[nodiscard]] std::vector<std::string> Visit(const std::filesystem::path& sent) const {
    std::vector<std::string> names;
    ForEachSentImage(sent, parts_, folder_.path() / "scratch",
                     [&](const CtImage& image, const std::string& name) {
                       EXPECT_FALSE(image.hu.empty());
                       names.push_back(name);
                     });
    return names;
  }
  [[nodiscard]] Message RefusalOf(const std::string& images) const {
    try {
      (void)Visit(Upload(images));
    } catch (const DataError& error) {
      return error.message();
    }
    return {};
  }

  const std::string plan_ = DicomBytes(SmallCt().second);
  const std::string image_ = DicomBytes(SmallImages().front());
  const SentParts parts_{.structures_bytes = 10, .plan_bytes = plan_.size()};
};

TEST_F(SentImagesTest, EachPartOfAnUploadBecomesWhatItWas) {
  const auto sent = Upload(Size(image_.size()) + image_ + Size(image_.size()) + image_);
  const PlanningFiles to{.structures = folder_.path() / "s", .plan = folder_.path() / "p"};
  SplitPlanning(sent, parts_, to);
  EXPECT_EQ(ReadTextFile(to.structures, 100), "structures");
  EXPECT_EQ(ReadTextFile(to.plan, 1 << 20), plan_);
  EXPECT_THAT(Visit(sent), ::testing::ElementsAre("CT 1", "CT 2"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "scratch")) << "it names the patient";
  // Without images the plan ends with the upload; without a structure set it begins it.
  SplitPlanning(Write("sent", plan_), {}, {.structures = {}, .plan = to.plan});
  EXPECT_EQ(ReadTextFile(to.plan, 1 << 20), plan_);
}

TEST_F(SentImagesTest, WhatIsCutOrNotThereIsRefused) {
  EXPECT_TRUE(RefusalOf(Size(image_.size()) + image_).empty());
  EXPECT_TRUE(RefusalOf("").Is(say::scan::kPlanningNoImages));
  for (const std::string& cut :
       {std::string("1234567"), Size(0), Size(image_.size() + 1) + image_,
        Size(image_.size()) + image_ + Size(1), Size(~std::uint64_t{0}) + image_})
    EXPECT_TRUE(RefusalOf(cut).Is(say::scan::kPlanningImagesCut)) << cut.size();
  EXPECT_TRUE(RefusalOf(Size(plan_.size()) + plan_).Is(say::dicom::kOtherKind));
  const auto refused = [&](const SentParts& parts) {
    EXPECT_THROW(SplitPlanning(Upload(""), parts,
                               {.structures = folder_.path() / "s", .plan = folder_.path() / "p"}),
                 DataError)
        << parts.structures_bytes << ", " << parts.plan_bytes;
  };
  const std::uint64_t all = 10 + plan_.size();
  refused({.structures_bytes = all});
  refused({.structures_bytes = 10, .plan_bytes = plan_.size() + 1});
  refused({.structures_bytes = 10, .plan_bytes = ~std::uint64_t{0}});
}

TEST_F(PlanningFilesTest, ATruncatedFileIsNeverHalfOfOne) {
  const auto [structures, plan] = SmallCt();
  const std::string bytes = DicomBytes(structures);
  for (std::size_t part = 1; part < 8; ++part)
    EXPECT_FALSE(Refusal(Write("cut.dcm", bytes.substr(0, part * bytes.size() / 8))).empty())
        << part << "/8";
}

TEST_F(PlanningFilesTest, NumbersThatAreNoneAreRefused) {
  const auto [structures, plan] = SmallCt();
  for (const char* wrong : {"nan", "1e9999", "12a", "--1"}) {
    auto bytes = DicomBytes(plan);
    const std::size_t at = bytes.find("72.5000");
    ASSERT_NE(at, std::string::npos);
    bytes.replace(at, 7, std::string(wrong).append(7 - std::string_view(wrong).size(), ' '));
    EXPECT_FALSE(Refusal(Write("plan.dcm", bytes)).empty()) << wrong;
  }
}

TEST(LockDownTest, AProcessCanOnlyReadWriteAndEnd) {
  const pid_t child = ::fork();
  if (child == 0) {
    LockDown();
    int wrong = 0;
    wrong |= ::open("/etc/hostname", O_RDONLY) < 0 && errno == EPERM ? 0 : 1;
    wrong |= ::socket(AF_INET, SOCK_STREAM, 0) < 0 && errno == EPERM ? 0 : 2;
    wrong |= ::execl("/bin/true", "true", nullptr) < 0 && errno == EPERM ? 0 : 4;
    wrong |= ::fork() < 0 && errno == EPERM ? 0 : 8;
    wrong |= ::kill(::getppid(), 0) < 0 && errno == EPERM ? 0 : 16;
    ::_exit(wrong);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  EXPECT_EQ(WEXITSTATUS(status), 0);
#endif
}

}  // namespace
}  // namespace plumb
