// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/export_objects.hpp"

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>

#include <cmath>
#include <memory>
#include <string>
#include <string_view>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/notice.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostShortText = 64;  // characters of the types LO and PN
constexpr std::size_t kRoomForTags = 64 << 10;
/// As much of the notice as an attribute holds.
constexpr std::string_view kShortNotice = "Research use only. Not a medical device.";
static_assert(kResearchNotice.starts_with(kShortNotice));

void Check(const OFCondition& condition) {
  if (condition.bad()) throw DataError(say::dicom::NotWritten(condition.text()));
}

/// Sets values, each checked by DCMTK.
class Writer {
 public:
  explicit Writer(DcmItem& item) : item_(item) {}

  void Text(const DcmTagKey& tag, const std::string& value) const {
    Check(item_.putAndInsertString(tag, value.c_str()));
  }
  void Whole(const DcmTagKey& tag, Uint16 value) const {
    Check(item_.putAndInsertUint16(tag, value));
  }
  void Empty(const DcmTagKey& tag) const { Check(item_.insertEmptyElement(tag)); }
  /// A new item at the end of a sequence.
  [[nodiscard]] Writer Item(const DcmTagKey& sequence) const {
    DcmItem* item = nullptr;
    Check(item_.findOrCreateSequenceItem(sequence, item, -2));
    return Writer(*item);
  }
  void Code(const DcmTagKey& sequence, const char* value, const char* scheme,
            const char* meaning) const {
    const Writer code = Item(sequence);
    code.Text(DCM_CodeValue, value);
    code.Text(DCM_CodingSchemeDesignator, scheme);
    code.Text(DCM_CodeMeaning, meaning);
  }
  void Bytes(const DcmTagKey& tag, DcmEVR kind, const std::vector<std::uint8_t>& bytes) const {
    auto element = std::make_unique<DcmOtherByteOtherWord>(DcmTag(tag, kind));
    Check(element->putUint8Array(bytes.data(), bytes.size()));
    Check(item_.insert(element.get()));
    (void)element.release();
  }

 private:
  DcmItem& item_;
};

/// Cut to so many bytes, and never within a character.
std::string CutText(const std::string& text, std::size_t most) {
  if (text.size() <= most) return text;
  std::size_t end = most;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0) == 0x80) --end;
  return text.substr(0, end);
}

/// As many digits as the 16 characters of a decimal string hold.
std::string DecimalString(double value) {
  if (std::abs(value) < 1e-12) value = 0.0;
  for (int digits = 14; digits > 1; --digits)
    if (std::string text = fmt::format("{:.{}g}", value, digits); text.size() <= 16) return text;
  return "0";
}

std::string ClassUid(DicomExportKind kind) {
  switch (kind) {
    case DicomExportKind::kReport:
      return UID_EncapsulatedPDFStorage;
    case DicomExportKind::kPicture:
      return UID_SecondaryCaptureImageStorage;
    case DicomExportKind::kSurface:
      return UID_EncapsulatedSTLStorage;
    case DicomExportKind::kPatient:
      return UID_RawDataStorage;
    case DicomExportKind::kRegistration:
      break;
  }
  return UID_SpatialRegistrationStorage;
}

const char* ModalityOf(DicomExportKind kind) {
  switch (kind) {
    case DicomExportKind::kReport:
      return "DOC";
    case DicomExportKind::kPicture:
    case DicomExportKind::kPatient:
      return "OT";
    case DicomExportKind::kSurface:
      return "M3D";
    case DicomExportKind::kRegistration:
      break;
  }
  return "REG";
}

/// What all objects have: patient, study, series, equipment, the object itself.
void PutCommon(const Writer& set, const DicomExport& object) {
  set.Text(DCM_SpecificCharacterSet, "ISO_IR 192");
  set.Text(DCM_SOPClassUID, ClassUid(object.kind));
  set.Text(DCM_SOPInstanceUID, object.instance_uid);
  for (const DcmTagKey& date : {DCM_StudyDate, DCM_SeriesDate, DCM_ContentDate})
    set.Text(date, object.date);
  for (const DcmTagKey& time : {DCM_StudyTime, DCM_SeriesTime, DCM_ContentTime})
    set.Text(time, object.time);
  set.Text(DCM_Modality, ModalityOf(object.kind));
  set.Text(DCM_PatientID, CutText(object.patient_id, kMostShortText));
  set.Text(DCM_PatientName, CutText(object.patient_name, kMostShortText));
  for (const DcmTagKey& unknown : {DCM_PatientBirthDate, DCM_PatientSex, DCM_AccessionNumber,
                                   DCM_ReferringPhysicianName, DCM_StudyID})
    set.Empty(unknown);
  set.Text(DCM_StudyInstanceUID, object.study_uid);
  set.Text(DCM_StudyDescription, "Plumb, research use only");
  set.Text(DCM_SeriesInstanceUID, object.series_uid);
  set.Text(DCM_SeriesDescription, CutText(object.title, kMostShortText));
  set.Text(DCM_SeriesNumber, std::to_string(object.series_number));
  set.Text(DCM_InstanceNumber, std::to_string(object.instance_number));
  set.Text(DCM_Manufacturer, "The Plumb authors");
  set.Text(DCM_ManufacturerModelName, "Plumb");
  set.Text(DCM_DeviceSerialNumber, "none");
  set.Text(DCM_SoftwareVersions, CutText(object.version, kMostShortText));
}

void PutDocument(const Writer& set, const DicomExport& object, const char* mime) {
  set.Empty(DCM_AcquisitionDateTime);
  set.Text(DCM_DocumentTitle, object.title);
  set.Empty(DCM_ConceptNameCodeSequence);
  set.Text(DCM_MIMETypeOfEncapsulatedDocument, mime);
  set.Bytes(DCM_EncapsulatedDocument, EVR_OB, object.payload);
}

void PutReport(const Writer& set, const DicomExport& object) {
  set.Text(DCM_ConversionType, "WSD");
  set.Text(DCM_BurnedInAnnotation, "YES");
  PutDocument(set, object, "application/pdf");
}

void PutSurface(const Writer& set, const DicomExport& object) {
  set.Text(DCM_FrameOfReferenceUID, object.frame_uid);
  set.Empty(DCM_PositionReferenceIndicator);
  set.Text(DCM_BurnedInAnnotation, "NO");
  PutDocument(set, object, "model/stl");
  set.Code(DCM_MeasurementUnitsCodeSequence, "mm", "UCUM", "mm");
  set.Text(DCM_ModelModification, "NO");
  set.Text(DCM_ModelMirroring, "NO");
  set.Text(DCM_ContentDescription, std::string(kShortNotice));
}

/// A Raw Data object with the attributes of an encapsulated document, which no archive shows.
void PutPatient(const Writer& set, const DicomExport& object) {
  set.Text(DCM_ContentDescription, std::string(kShortNotice));
  PutDocument(set, object, "application/octet-stream");
}

void PutPicture(const Writer& set, const DicomExport& object) {
  const auto pixels =
      static_cast<std::size_t>(object.width) * static_cast<std::size_t>(object.height);
  if (object.width <= 0 || object.height <= 0 || object.width > 0xFFFF || object.height > 0xFFFF ||
      object.payload.size() != 3 * pixels)
    throw DataError(say::dicom::NotWritten("the picture's size"));
  set.Text(DCM_ConversionType, "WSD");
  set.Text(DCM_BurnedInAnnotation, "YES");
  set.Empty(DCM_PatientOrientation);
  set.Whole(DCM_SamplesPerPixel, 3);
  set.Text(DCM_PhotometricInterpretation, "RGB");
  set.Whole(DCM_PlanarConfiguration, 0);
  set.Whole(DCM_Rows, static_cast<Uint16>(object.height));
  set.Whole(DCM_Columns, static_cast<Uint16>(object.width));
  set.Whole(DCM_BitsAllocated, 8);
  set.Whole(DCM_BitsStored, 8);
  set.Whole(DCM_HighBit, 7);
  set.Whole(DCM_PixelRepresentation, 0);
  set.Bytes(DCM_PixelData, EVR_OB, object.payload);
}

void PutMatrix(const Writer& set, const std::string& frame, const Eigen::Matrix4d& T,
               const char* code, const char* meaning) {
  const Writer frame_item = set.Item(DCM_RegistrationSequence);
  frame_item.Text(DCM_FrameOfReferenceUID, frame);
  const Writer registration = frame_item.Item(DCM_MatrixRegistrationSequence);
  registration.Code(DCM_RegistrationTypeCodeSequence, code, "DCM", meaning);
  const Writer matrix = registration.Item(DCM_MatrixSequence);
  std::string values;
  for (int i = 0; i < 16; ++i) {
    if (i > 0) values += '\\';
    values += DecimalString(T(i / 4, i % 4));
  }
  matrix.Text(DCM_FrameOfReferenceTransformationMatrix, values);
  matrix.Text(DCM_FrameOfReferenceTransformationMatrixType, "RIGID");
}

void PutRegistration(const Writer& set, const DicomExport& object) {
  set.Text(DCM_FrameOfReferenceUID, object.frame_uid);
  set.Empty(DCM_PositionReferenceIndicator);
  set.Text(DCM_ContentLabel, "SURFACE_IN_ROOM");
  set.Text(DCM_ContentDescription, std::string(kShortNotice));
  set.Empty(DCM_ContentCreatorName);
  PutMatrix(set, object.frame_uid, Eigen::Matrix4d::Identity(), "125021",
            "Frame of Reference Identity");
  PutMatrix(set, object.moving_frame_uid, object.T_frame_moving_mm, "125022", "Fiducial Alignment");
}

std::vector<std::uint8_t> BytesOf(DcmFileFormat& format, std::size_t most) {
  std::vector<std::uint8_t> bytes(most);
  DcmOutputBufferStream stream(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  format.transferInit();
  Check(format.write(stream, EXS_LittleEndianExplicit, EET_ExplicitLength, nullptr));
  format.transferEnd();
  void* written = nullptr;
  offile_off_t length = 0;
  stream.flushBuffer(written, length);
  bytes.resize(static_cast<std::size_t>(length));
  return bytes;
}

}  // namespace

void PrepareDicomWriting() {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  if (!dcmDataDict.isDictionaryLoaded()) throw IoError(say::dicom::NoDictionary());
}

std::vector<std::uint8_t> EncodeDicom(const DicomExport& object) {
  DcmFileFormat format;
  const Writer set(*format.getDataset());
  PutCommon(set, object);
  switch (object.kind) {
    case DicomExportKind::kReport:
      PutReport(set, object);
      break;
    case DicomExportKind::kPicture:
      PutPicture(set, object);
      break;
    case DicomExportKind::kSurface:
      PutSurface(set, object);
      break;
    case DicomExportKind::kRegistration:
      PutRegistration(set, object);
      break;
    case DicomExportKind::kPatient:
      PutPatient(set, object);
      break;
  }
  if (object.kind == DicomExportKind::kReport || object.kind == DicomExportKind::kSurface ||
      object.kind == DicomExportKind::kPatient)
    Check(format.getDataset()->putAndInsertUint32(DCM_EncapsulatedDocumentLength,
                                                  static_cast<Uint32>(object.payload.size())));
  Check(format.validateMetaInfo(EXS_LittleEndianExplicit));
  return BytesOf(format, object.payload.size() + kRoomForTags);
}

}  // namespace plumb
