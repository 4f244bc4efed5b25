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

#include "algo/base/errors.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/dicom/small_files.hpp"
#include "words/dicom.hpp"

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
  const StructureSet read = ReadStructureSet(Write("structures.dcm", DicomBytes(written)));
  EXPECT_EQ(read.file.instance_uid, written.file.instance_uid);
  EXPECT_EQ(read.file.patient_id, "SIM-1");
  EXPECT_EQ(read.file.date, "20260101 080000");
  EXPECT_EQ(read.file.frame_of_reference_uid, "2.25.52");
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

// Signed pixels, a padding value, and what is refused: each by one value of the file.
TEST_F(PlanningFilesTest, PixelsAreWhatTheFileSaysOrRefused) {
  const CtImage image = SmallImages().front();
  const std::string bytes = DicomBytes(image);
  const auto changed = [&](const std::string& tag, std::size_t at, const std::string& value) {
    std::string copy = bytes;
    const std::size_t found = copy.find(tag);
    EXPECT_NE(found, std::string::npos) << tag;
    return copy.replace(found + at, value.size(), value);
  };
  const auto word = [](int value) {
    return std::string{static_cast<char>(value & 0xFF), static_cast<char>(value >> 8)};
  };
  using namespace std::string_literals;
  // 12 bits that are signed: 2048 and more are negative.
  const auto is_signed =
      ReadDicomFile(Write("i.dcm", changed("\x28\0\x03\x01US"s, 8, word(1)))).image;
  ASSERT_TRUE(is_signed);
  EXPECT_NEAR(is_signed->hu.front(), image.hu.front(), 0.51);
  const auto steeper = ReadDicomFile(Write("i.dcm", changed("\x28\0\x53\x10"s, 8, "2 "))).image;
  ASSERT_TRUE(steeper);
  EXPECT_NEAR(steeper->hu.front(), 2 * (image.hu.front() + 1024) - 1024, 1.1);
  const auto refused = [&](const std::string& changed_bytes) {
    const auto file = Write("i.dcm", changed_bytes);
    EXPECT_THROW(ForEachCtImage({file}, [](const CtImage&, const std::string&) {}), DataError);
  };
  refused(changed("\x28\0\0\x01US"s, 8, word(8)));     // bits allocated
  refused(changed("\x28\0\x02\x01US"s, 8, word(15)));  // high bit
  refused(changed("\x28\0\x02\0US"s, 8, word(3)));     // colours
  refused(changed("\x28\0\x10\0US"s, 8, word(4000)));  // rows
  refused(changed("\x28\0\x10\0US"s, 8, word(image.rows + 1)));
  refused(changed("\x28\0\x53\x10"s, 8, "0 "));  // slope
  refused(bytes.substr(0, bytes.size() - 400));
  const std::string compressed =
      changed("1.2.840.10008.1.2.1\0"s, 0, "1.2.840.10008.1.2.5\0"s);  // RLE
  refused(compressed);
  // It is described all the same.
  const PlanningContent described =
      ReadDicomFile(Write("i.dcm", changed("\x28\0\x53\x10"s, 8, "0 ")));
  EXPECT_EQ(described.modality, "CT");
  EXPECT_EQ(described.file.frame_of_reference_uid, "2.25.52");
  EXPECT_TRUE(described.image_fault.Is(say::dicom::kImageFormat));
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
