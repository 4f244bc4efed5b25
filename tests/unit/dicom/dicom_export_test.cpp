// SPDX-License-Identifier: Apache-2.0
// What is given away as DICOM, read back by DCMTK.
#include "drivers/dicom/dicom_export.hpp"

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>

#include <cmath>
#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "algo/base/errors.hpp"
#include "daemon/dicom/result_export.hpp"
#include "daemon/mesh_formats/mesh_file.hpp"
#include "drivers/files/file_io.hpp"
#include "tests/support/temp_folder.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb {
namespace {

class DicomExportTest : public ::testing::Test {
 protected:
  static DicomExport Object(DicomExportKind kind) {
    DicomExport object;
    object.kind = kind;
    object.patient_id = object.patient_name = "PLUMB-1";
    object.study_uid = "2.25.1";
    object.series_uid = "2.25.2";
    object.instance_uid = "2.25.3";
    object.date = "20260314";
    object.time = "150926";
    object.title = "Fl\u00e4che";
    object.version = "0.3.0";
    return object;
  }
  /// Writes the object and reads the file.
  DcmDataset& WrittenAndRead(const DicomExport& object) {
    const auto file = folder_.path() / "object.dcm";
    WriteDicomExport(object, file);
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "object.dcm.request"));
    EXPECT_TRUE(format_.loadFile(file.c_str()).good());
    return *format_.getDataset();
  }
  static std::string TextIn(DcmItem& item, const DcmTagKey& tag) {
    OFString text;
    (void)item.findAndGetOFStringArray(tag, text);
    return text.c_str();
  }
  static std::vector<std::uint8_t> BytesIn(DcmItem& item, const DcmTagKey& tag, Uint32 count) {
    const Uint8* bytes = nullptr;
    unsigned long length = 0;
    if (item.findAndGetUint8Array(tag, bytes, &length).bad() || length < count) return {};
    return {bytes, bytes + count};
  }

  testing::TempFolder folder_;
  DcmFileFormat format_;
};

TEST_F(DicomExportTest, ASurfaceKeepsItsTriangles) {
  const TriangleMesh mesh = BoxMesh();
  WriteMeshFile(folder_.path() / "box.stl", mesh, MeshUnit::kMillimetres);
  DicomExport object = Object(DicomExportKind::kSurface);
  object.frame_uid = "2.25.77";
  object.payload = ReadWholeFile(folder_.path() / "box.stl", 1 << 20);
  DcmDataset& read = WrittenAndRead(object);
  EXPECT_EQ(TextIn(read, DCM_SOPClassUID), "1.2.840.10008.5.1.4.1.1.104.3");
  EXPECT_EQ(TextIn(read, DCM_FrameOfReferenceUID), "2.25.77");
  EXPECT_EQ(TextIn(read, DCM_MIMETypeOfEncapsulatedDocument), "model/stl");
  DcmItem* unit = nullptr;
  ASSERT_TRUE(read.findAndGetSequenceItem(DCM_MeasurementUnitsCodeSequence, unit).good());
  EXPECT_EQ(TextIn(*unit, DCM_CodeValue), "mm");
  Uint32 length = 0;
  ASSERT_TRUE(read.findAndGetUint32(DCM_EncapsulatedDocumentLength, length).good());
  ASSERT_EQ(length, 84 + 50 * mesh.triangles.size());
  const std::vector<std::uint8_t> stl = BytesIn(read, DCM_EncapsulatedDocument, length);
  ASSERT_EQ(stl.size(), length);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      Eigen::Vector3f p;
      std::memcpy(p.data(), stl.data() + 84 + 50 * t + 12 * (corner + 1), 12);
      EXPECT_EQ(p, 1000.0F * mesh.vertices[mesh.triangles[t][corner]]) << t << " " << corner;
    }
  }
}

TEST_F(DicomExportTest, ARegistrationKeepsItsMatrix) {
  DicomExport object = Object(DicomExportKind::kRegistration);
  object.frame_uid = "2.25.52";
  object.moving_frame_uid = "2.25.53";
  const Pose T = Eigen::Translation3d(-1234.56789, 0.000123, 98765.4321) *
                 Pose(RotationFromVector({0.3, -1.2, 2.0}));
  object.T_frame_moving_mm = T.matrix();
  DcmDataset& read = WrittenAndRead(object);
  EXPECT_EQ(TextIn(read, DCM_SOPClassUID), "1.2.840.10008.5.1.4.1.1.66.1");
  for (const long number : {0L, 1L}) {
    DcmItem *frame = nullptr, *registration = nullptr, *matrix = nullptr;
    ASSERT_TRUE(read.findAndGetSequenceItem(DCM_RegistrationSequence, frame, number).good());
    ASSERT_TRUE(frame->findAndGetSequenceItem(DCM_MatrixRegistrationSequence, registration).good());
    ASSERT_TRUE(registration->findAndGetSequenceItem(DCM_MatrixSequence, matrix).good());
    EXPECT_EQ(TextIn(*frame, DCM_FrameOfReferenceUID), number == 0 ? "2.25.52" : "2.25.53");
    EXPECT_EQ(TextIn(*matrix, DCM_FrameOfReferenceTransformationMatrixType), "RIGID");
    const Eigen::Matrix4d expected =
        number == 0 ? Eigen::Matrix4d(Eigen::Matrix4d::Identity()) : object.T_frame_moving_mm;
    for (unsigned long i = 0; i < 16; ++i) {
      Float64 value = NAN;
      ASSERT_TRUE(
          matrix->findAndGetFloat64(DCM_FrameOfReferenceTransformationMatrix, value, i).good());
      // sixteen characters hold a shift of 100 m to 1e-8 mm
      EXPECT_NEAR(value, expected(static_cast<int>(i / 4), static_cast<int>(i % 4)), 1e-8) << i;
    }
  }
}

TEST_F(DicomExportTest, APictureKeepsItsPixelsAndSaysThatItIsWrittenOn) {
  DicomExport object = Object(DicomExportKind::kPicture);
  object.width = 3;
  object.height = 5;  // an odd number of bytes
  for (std::uint8_t i = 0; i < 45; ++i) object.payload.push_back(i);
  DcmDataset& read = WrittenAndRead(object);
  EXPECT_EQ(TextIn(read, DCM_BurnedInAnnotation), "YES");
  EXPECT_EQ(TextIn(read, DCM_PhotometricInterpretation), "RGB");
  EXPECT_EQ(BytesIn(read, DCM_PixelData, 45), object.payload);
  object.payload.pop_back();
  EXPECT_THROW(WriteDicomExport(object, folder_.path() / "cut.dcm"), DataError);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "cut.dcm"));
}

TEST_F(DicomExportTest, AReportIsThePdfWithTheCodeOnly) {
  DicomExport object = Object(DicomExportKind::kReport);
  object.payload = {'%', 'P', 'D', 'F', '-'};
  DcmDataset& read = WrittenAndRead(object);
  EXPECT_EQ(TextIn(read, DCM_SOPClassUID), "1.2.840.10008.5.1.4.1.1.104.1");
  EXPECT_EQ(TextIn(read, DCM_DocumentTitle), "Fl\u00e4che");
  EXPECT_EQ(TextIn(read, DCM_PatientID), "PLUMB-1");
  EXPECT_EQ(TextIn(read, DCM_PatientBirthDate), "");
  EXPECT_EQ(BytesIn(read, DCM_EncapsulatedDocument, 5), object.payload);
}

TEST(DicomUidTest, TheFirstHalfOfADigestIsADecimalNumber) {
  EXPECT_EQ(UidOfDigest("000000000000000000000000000000ffab"), "2.25.255");
  EXPECT_EQ(UidOfDigest("ffffffffffffffffffffffffffffffff"),
            "2.25.340282366920938463463374607431768211455");
}

StoredResult PlannedResult(const char* posture) {
  StoredResult result;
  result.alignment.emplace();
  result.compared_with.emplace();
  result.compared_with->posture = posture;
  result.compared_with->isocentre_lps_mm = {72.530, -304.345, -9.309};
  return result;
}

// The table of the axes of IEC 61217 in each position, the other way round: where in the patient
// the point lies that is 1 mm to the right, 2 mm to the gantry and 3 mm up from the isocentre.
TEST(SurfaceInPlanTest, SignsFollowTheTableOfEachPosition) {
  const std::array<std::pair<const char*, Eigen::Vector3d>, 4> expected = {
      {{"HFS", {1, -3, 2}}, {"HFP", {-1, 3, 2}}, {"FFS", {-1, -3, -2}}, {"FFP", {1, 3, -2}}}};
  for (const auto& [posture, lps] : expected) {
    const StoredResult result = PlannedResult(posture);
    const Eigen::Vector4d p = ReferenceFromSurface_mm(result) * Eigen::Vector4d(1, 2, 3, 1);
    EXPECT_LT((p.head<3>() - result.compared_with->isocentre_lps_mm - lps).norm(), 1e-12)
        << posture;
  }
}

TEST(SurfaceInPlanTest, TheSurfaceIsFirstPlacedInTheRoom) {
  StoredResult result = PlannedResult("HFS");
  result.alignment->T_reference_current(0, 3) = 0.010;  // metres, to the right
  const Eigen::Matrix4d T = ReferenceFromSurface_mm(result);
  EXPECT_NEAR(T(0, 3), 72.530 + 10.0, 1e-9);
  EXPECT_NEAR(T.topLeftCorner(3, 3).determinant(), 1.0, 1e-12);
  result.compared_with.reset();  // a captured reference: its own axes
  EXPECT_NEAR(ReferenceFromSurface_mm(result)(0, 3), 10.0, 1e-9);
}

}  // namespace
}  // namespace plumb
