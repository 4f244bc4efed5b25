// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_objects.hpp"

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/oflog/oflog.h>

#include <charconv>
#include <cmath>
#include <span>
#include <string_view>
#include <utility>

#include "algo/base/errors.hpp"
#include "algo/base/plain_text.hpp"
#include "algo/base/utf8.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostText = 256;
constexpr unsigned long kMostItems = 100'000;

std::string_view Trimmed(std::string_view text) {
  constexpr std::string_view kBlank(" \0\t\r\n", 5);
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::string NameOf(const DcmTagKey& tag) { return tag.toString().c_str(); }

/// One level of a data set, with the character set of the whole.
class Item {
 public:
  Item(DcmItem& item, bool is_utf8) : item_(item), is_utf8_(is_utf8) {}

  /// Empty where the value is missing. Of several values all, as they stand in the file.
  [[nodiscard]] std::string Text(const DcmTagKey& tag) const {
    const std::string_view raw = Trimmed(Raw(tag)).substr(0, kMostText);
    if (is_utf8_) return AsPlainText(raw);
    // Latin-1, the usual set of Western planning systems; of others the letters are wrong, but
    // names still differ.
    std::string text;
    for (const char c : raw) {
      const auto code = static_cast<unsigned char>(c);
      if (code < 0x80) {
        text += c;
      } else {
        text += static_cast<char>(0xC0 | (code >> 6));
        text += static_cast<char>(0x80 | (code & 0x3F));
      }
    }
    return AsPlainText(text);
  }

  /// Numbers of a decimal or integer string. Longer than the 16 characters of the standard, with
  /// exponents: whatever writers write.
  [[nodiscard]] std::vector<double> Numbers(const DcmTagKey& tag) const {
    std::vector<double> numbers;
    std::string_view left = Trimmed(Raw(tag));
    while (!left.empty()) {
      const std::size_t end = left.find('\\');
      std::string_view word = Trimmed(left.substr(0, end));
      if (word.starts_with('+')) word.remove_prefix(1);
      double number = 0.0;
      const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), number);
      if (error != std::errc() || stop != word.data() + word.size() || !std::isfinite(number))
        throw DataError(say::dicom::NoNumber(NameOf(tag), ValidUtf8(word.substr(0, 40))));
      numbers.push_back(number);
      left = end == std::string_view::npos ? std::string_view() : left.substr(end + 1);
    }
    return numbers;
  }

  [[nodiscard]] std::optional<double> Number(const DcmTagKey& tag) const {
    const std::vector<double> numbers = Numbers(tag);
    return numbers.empty() ? std::nullopt : std::optional(numbers.front());
  }
  [[nodiscard]] std::optional<std::int64_t> Whole(const DcmTagKey& tag) const {
    const std::optional<double> number = Number(tag);
    if (!number) return std::nullopt;
    if (!(std::abs(*number) < 1e12)) throw DataError(say::dicom::NoNumber(NameOf(tag), Text(tag)));
    return static_cast<std::int64_t>(*number);
  }
  /// An angle that stands as binary; 0 where it is missing.
  [[nodiscard]] double Binary(const DcmTagKey& tag) const {
    Float32 number = 0.0F;
    if (item_.findAndGetFloat32(tag, number).bad()) return Number(tag).value_or(0.0);
    if (!std::isfinite(number)) throw DataError(say::dicom::NoNumber(NameOf(tag), "nan"));
    return number;
  }
  [[nodiscard]] std::optional<Eigen::Vector3d> Point(const DcmTagKey& tag) const {
    if (Numbers(tag).empty()) return std::nullopt;
    return Eigen::Vector3d(Required(tag, 3).data());
  }
  /// As many numbers as expected.
  [[nodiscard]] std::vector<double> Required(const DcmTagKey& tag, std::int64_t expected) const {
    std::vector<double> numbers = Numbers(tag);
    const auto found = static_cast<std::int64_t>(numbers.size());
    if (found == 0) throw DataError(say::dicom::Missing(NameOf(tag)));
    if (found != expected) throw DataError(say::dicom::NumbersWrong(NameOf(tag), found, expected));
    return numbers;
  }

  /// Values of 16 bits, such as pixels; borrowed from the data set.
  [[nodiscard]] std::span<const Uint16> Words(const DcmTagKey& tag) const {
    const Uint16* words = nullptr;
    unsigned long count = 0;
    if (item_.findAndGetUint16Array(tag, words, &count).bad() || words == nullptr) return {};
    return {words, count};
  }
  /// One that stands as binary.
  [[nodiscard]] std::int64_t Word(const DcmTagKey& tag, std::int64_t missing) const {
    const std::span<const Uint16> words = Words(tag);
    return words.empty() ? missing : words.front();
  }

  /// The bits of what stands for pixels without a value; signed or not as the pixels are.
  [[nodiscard]] std::optional<std::int64_t> Padding() const {
    Sint16 value = 0;
    if (item_.findAndGetSint16(DCM_PixelPaddingValue, value).good()) return value;
    const std::span<const Uint16> words = Words(DCM_PixelPaddingValue);
    return words.empty() ? std::nullopt : std::optional<std::int64_t>(words.front());
  }

  /// Calls visit(Item) for each item of a sequence, if there is one.
  template <typename Visit>
  void ForEach(const DcmTagKey& tag, const Visit& visit) const {
    DcmSequenceOfItems* sequence = nullptr;
    if (item_.findAndGetSequence(tag, sequence).bad() || sequence == nullptr) return;
    const unsigned long count = sequence->card();
    if (count > kMostItems) throw DataError(say::dicom::TooManyItems(NameOf(tag)));
    // By index it would be quadratic.
    for (DcmObject* at = sequence->nextInContainer(nullptr); at != nullptr;
         at = sequence->nextInContainer(at)) {
      if (auto* const item = dynamic_cast<DcmItem*>(at)) visit(Item(*item, is_utf8_));
    }
  }
  /// The first item of a sequence, if there is one.
  template <typename Visit>
  void First(const DcmTagKey& tag, const Visit& visit) const {
    bool done = false;
    ForEach(tag, [&](const Item& item) {
      if (!done) visit(item);
      done = true;
    });
  }

 private:
  [[nodiscard]] std::string_view Raw(const DcmTagKey& tag) const {
    DcmElement* element = nullptr;
    if (item_.findAndGetElement(tag, element).bad() || element == nullptr) return {};
    // What is no string, such as what stayed UN, has no text.
    char* text = nullptr;
    Uint32 length = 0;
    if (element->getString(text, length).bad() || text == nullptr) return {};
    return {text, length};
  }

  DcmItem& item_;
  bool is_utf8_;
};

PlanningFile FileOf(const Item& set, const DcmTagKey& label, const DcmTagKey& date,
                    const DcmTagKey& time) {
  PlanningFile file;
  file.class_uid = set.Text(DCM_SOPClassUID);
  file.instance_uid = set.Text(DCM_SOPInstanceUID);
  file.patient_id = set.Text(DCM_PatientID);
  file.patient_name = set.Text(DCM_PatientName);
  file.label = set.Text(label);
  file.date = set.Text(date);
  if (const std::string hour = set.Text(time).substr(0, 6); !file.date.empty() && !hour.empty())
    file.date += " " + hour;
  file.frame_of_reference_uid = set.Text(DCM_FrameOfReferenceUID);
  return file;
}

PlannedContour ContourOf(const Item& item, std::size_t& num_points) {
  PlannedContour contour;
  contour.kind = item.Text(DCM_ContourGeometricType);
  contour.stated_points = item.Whole(DCM_NumberOfContourPoints).value_or(-1);
  const std::vector<double> numbers = item.Numbers(DCM_ContourData);
  if (numbers.size() % 3 != 0)
    throw DataError(say::dicom::ContourNumbers(static_cast<std::int64_t>(numbers.size())));
  num_points += numbers.size() / 3;
  if (num_points > kMostContourPoints)
    throw DataError(say::dicom::TooManyPoints(static_cast<std::int64_t>(kMostContourPoints)));
  for (std::size_t i = 0; i < numbers.size(); i += 3)
    contour.points_mm.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  return contour;
}

/// The images that a frame of reference of a structure set names, whether contours lie in them or
/// not.
void AddImagesOf(const Item& frame, StructureSet& structures) {
  frame.ForEach(DCM_RTReferencedStudySequence, [&](const Item& study) {
    study.ForEach(DCM_RTReferencedSeriesSequence, [&](const Item& series) {
      const std::string series_uid = series.Text(DCM_SeriesInstanceUID);
      if (series_uid.empty()) return;  // such items name nothing
      std::vector<std::string>& uids = structures.image_uids[series_uid];
      series.ForEach(DCM_ContourImageSequence, [&](const Item& image) {
        if (std::string uid = image.Text(DCM_ReferencedSOPInstanceUID); !uid.empty())
          uids.push_back(std::move(uid));
      });
    });
  });
}

StructureSet StructuresOf(const Item& set) {
  StructureSet structures;
  structures.file = FileOf(set, DCM_StructureSetLabel, DCM_StructureSetDate, DCM_StructureSetTime);
  set.First(DCM_ReferencedFrameOfReferenceSequence, [&](const Item& frame) {
    // That of the images; a frame of the file itself says nothing of the contours.
    structures.file.frame_of_reference_uid = frame.Text(DCM_FrameOfReferenceUID);
  });
  set.ForEach(DCM_ReferencedFrameOfReferenceSequence,
              [&](const Item& frame) { AddImagesOf(frame, structures); });
  const auto find = [&](std::int64_t number) -> PlannedRoi* {
    for (PlannedRoi& roi : structures.rois)
      if (roi.number == number) return &roi;
    return nullptr;
  };
  set.ForEach(DCM_StructureSetROISequence, [&](const Item& item) {
    PlannedRoi& roi = structures.rois.emplace_back();
    roi.number = item.Whole(DCM_ROINumber).value_or(-1);
    roi.name = item.Text(DCM_ROIName);
    roi.frame_of_reference_uid = item.Text(DCM_ReferencedFrameOfReferenceUID);
  });
  set.ForEach(DCM_RTROIObservationsSequence, [&](const Item& item) {
    PlannedRoi* const roi = find(item.Whole(DCM_ReferencedROINumber).value_or(-2));
    if (roi != nullptr) roi->type = item.Text(DCM_RTROIInterpretedType);
  });
  std::size_t num_points = 0;
  set.ForEach(DCM_ROIContourSequence, [&](const Item& item) {
    PlannedRoi* const roi = find(item.Whole(DCM_ReferencedROINumber).value_or(-2));
    item.ForEach(DCM_ContourSequence, [&](const Item& contour) {
      PlannedContour read = ContourOf(contour, num_points);
      if (roi != nullptr) roi->contours.push_back(std::move(read));
    });
  });
  return structures;
}

PlannedBeam BeamOf(const Item& item) {
  PlannedBeam beam;
  beam.number = item.Whole(DCM_BeamNumber).value_or(-1);
  beam.name = item.Text(DCM_BeamName);
  if (beam.name.empty()) beam.name = std::to_string(beam.number);
  beam.setup = item.Whole(DCM_ReferencedPatientSetupNumber);
  item.First(DCM_ControlPointSequence, [&](const Item& point) {
    beam.isocentre_mm = point.Point(DCM_IsocenterPosition);
    beam.couch_deg = point.Number(DCM_PatientSupportAngle).value_or(0.0);
    beam.pitch_deg = point.Binary(DCM_TableTopPitchAngle);
    beam.roll_deg = point.Binary(DCM_TableTopRollAngle);
  });
  return beam;
}

PatientSetup SetupOf(const Item& item) {
  PatientSetup setup;
  setup.number = item.Whole(DCM_PatientSetupNumber).value_or(-1);
  setup.position = item.Text(DCM_PatientPosition);
  if (setup.position.empty()) setup.position = item.Text(DCM_PatientAdditionalPosition);
  for (const DcmTagKey& tag :
       {DCM_TableTopVerticalSetupDisplacement, DCM_TableTopLongitudinalSetupDisplacement,
        DCM_TableTopLateralSetupDisplacement})
    setup.has_displacement =
        setup.has_displacement || std::abs(item.Number(tag).value_or(0.0)) > 0.01;
  return setup;
}

TreatmentPlan PlanOf(const Item& set) {
  TreatmentPlan plan;
  plan.file = FileOf(set, DCM_RTPlanLabel, DCM_RTPlanDate, DCM_RTPlanTime);
  plan.geometry = set.Text(DCM_RTPlanGeometry);
  plan.approval = set.Text(DCM_ApprovalStatus);
  set.First(DCM_ReferencedStructureSetSequence, [&](const Item& item) {
    plan.structure_set_uid = item.Text(DCM_ReferencedSOPInstanceUID);
  });
  set.ForEach(DCM_PatientSetupSequence,
              [&](const Item& item) { plan.setups.push_back(SetupOf(item)); });
  set.ForEach(DCM_BeamSequence, [&](const Item& item) { plan.beams.push_back(BeamOf(item)); });
  return plan;
}

/// How pixels of 16 bits become Hounsfield units.
struct PixelScale {
  std::int64_t bits = 16, is_signed = 0;
  double slope = 1.0, intercept = 0.0;
  std::optional<std::int64_t> nothing = {};  ///< Value of pixels outside the field of view.

  [[nodiscard]] std::int64_t Stored(std::int64_t word) const {
    const std::int64_t range = std::int64_t{1} << bits;
    const std::int64_t value = word & (range - 1);
    return is_signed != 0 && value >= range / 2 ? value - range : value;
  }
  [[nodiscard]] float Hu(Uint16 word) const {
    const std::int64_t value = Stored(word);
    return static_cast<float>(nothing == value ? kNothing_hu
                                               : slope * static_cast<double>(value) + intercept);
  }
};

PixelScale ScaleOf(const Item& set) {
  const auto expect = [&](const DcmTagKey& tag, std::int64_t found, std::int64_t least,
                          std::int64_t most) {
    if (found < least || found > most)
      throw DataError(say::dicom::ImageFormat(NameOf(tag), std::to_string(found)));
    return found;
  };
  expect(DCM_NumberOfFrames, set.Whole(DCM_NumberOfFrames).value_or(1), 1, 1);
  expect(DCM_SamplesPerPixel, set.Word(DCM_SamplesPerPixel, 1), 1, 1);
  expect(DCM_BitsAllocated, set.Word(DCM_BitsAllocated, 0), 16, 16);
  PixelScale scale;
  scale.bits = expect(DCM_BitsStored, set.Word(DCM_BitsStored, 0), 8, 16);
  expect(DCM_HighBit, set.Word(DCM_HighBit, 0), scale.bits - 1, scale.bits - 1);
  scale.is_signed = expect(DCM_PixelRepresentation, set.Word(DCM_PixelRepresentation, -1), 0, 1);
  if (const auto nothing = set.Padding()) scale.nothing = scale.Stored(*nothing);
  const auto scaled_by = [&](const DcmTagKey& tag, double least, double most) {
    const double value = set.Required(tag, 1).front();
    if (!(std::abs(value) >= least && std::abs(value) < most))
      throw DataError(say::dicom::ImageScale(NameOf(tag), set.Text(tag)));
    return value;
  };
  scale.slope = scaled_by(DCM_RescaleSlope, 1e-6, 1e3);
  scale.intercept = scaled_by(DCM_RescaleIntercept, 0.0, 1e5);
  return scale;
}

CtImage ImageOf(const Item& set) {
  CtImage image;
  image.series_uid = set.Text(DCM_SeriesInstanceUID);
  image.position = set.Text(DCM_PatientPosition);
  image.rows = static_cast<int>(set.Word(DCM_Rows, 0));
  image.columns = static_cast<int>(set.Word(DCM_Columns, 0));
  const auto is_side = [](int side) { return side >= 1 && side <= kMostImageSide; };
  if (!is_side(image.rows) || !is_side(image.columns))
    throw DataError(say::dicom::ImageSize(image.columns, image.rows, kMostImageSide));
  image.origin_mm = Eigen::Vector3d(set.Required(DCM_ImagePositionPatient, 3).data());
  const std::vector<double> directions = set.Required(DCM_ImageOrientationPatient, 6);
  const std::vector<double> spacing = set.Required(DCM_PixelSpacing, 2);
  image.along_row = Eigen::Vector3d(directions.data());
  image.along_column = Eigen::Vector3d(directions.data() + 3);
  image.row_spacing_mm = spacing[0];
  image.column_spacing_mm = spacing[1];
  const PixelScale scale = ScaleOf(set);
  const std::span<const Uint16> words = set.Words(DCM_PixelData);
  const std::int64_t expected = std::int64_t{image.rows} * image.columns;
  if (static_cast<std::int64_t>(words.size()) != expected)
    throw DataError(say::dicom::ImageCut(static_cast<std::int64_t>(words.size()), expected));
  image.hu.reserve(words.size());
  for (const Uint16 word : words) image.hu.push_back(scale.Hu(word));
  return image;
}

}  // namespace

void PrepareDicom() {
  OFLog::configure(OFLogger::OFF_LOG_LEVEL);
  // Contour data of more than 64 KB stand as UN in many files; they are nothing otherwise.
  dcmEnableUnknownVRConversion.set(OFTrue);
  if (!dcmDataDict.isDictionaryLoaded()) throw IoError(say::dicom::NoDictionary());
}

PlanningContent ReadDicom(std::span<const std::uint8_t> bytes) {
  DcmInputBufferStream stream;
  stream.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  stream.setEos();
  DcmFileFormat format;
  format.transferInit();
  const OFCondition read = format.read(stream, EXS_Unknown, EGL_noChange, DCM_MaxReadLength);
  format.transferEnd();
  DcmDataset* const data = format.getDataset();
  if (read.bad() || data == nullptr || data->isEmpty())
    throw DataError(say::dicom::Unreadable(ValidUtf8(read.text())));
  OFString set;
  (void)data->findAndGetOFStringArray(DCM_SpecificCharacterSet, set);
  const Item root(*data, set.find("ISO_IR 192") != OFString_npos);
  PlanningContent content;
  content.modality = root.Text(DCM_Modality);
  const std::string class_uid = root.Text(DCM_SOPClassUID);
  if (class_uid == UID_RTStructureSetStorage) {
    content.structures = StructuresOf(root);
    content.file = content.structures->file;
  } else if (class_uid == UID_RTPlanStorage) {
    content.plan = PlanOf(root);
    content.file = content.plan->file;
  } else if (class_uid == UID_CTImageStorage) {
    content.file = FileOf(root, DCM_SeriesDescription, DCM_SeriesDate, DCM_SeriesTime);
    try {
      const DcmXfer syntax(data->getOriginalXfer());
      if (syntax.isEncapsulated())
        throw DataError(say::dicom::ImageCompressed(syntax.getXferName()));
      content.image = ImageOf(root);
      content.image->file = content.file;
    } catch (const DataError& why) {
      content.image_fault = why.message();  // it can be described, not used
    }
  } else {
    content.file = FileOf(root, DCM_SeriesDescription, DCM_SeriesDate, DCM_SeriesTime);
  }
  return content;
}

}  // namespace plumb
