// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/dicom_writer.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include <fmt/format.h>

namespace plumb {
namespace {

constexpr std::size_t kMostShort = 65534;  // bytes of a value with a length of 16 bits

void Put16(std::string& bytes, unsigned value) {
  bytes += static_cast<char>(value & 0xFF);
  bytes += static_cast<char>(value >> 8 & 0xFF);
}

void Put32(std::string& bytes, std::size_t value) {
  Put16(bytes, static_cast<unsigned>(value & 0xFFFF));
  Put16(bytes, static_cast<unsigned>(value >> 16 & 0xFFFF));
}

std::string Tag(std::uint32_t tag) {
  std::string bytes;
  Put16(bytes, tag >> 16);
  Put16(bytes, tag & 0xFFFF);
  return bytes;
}

/// @param tag  Group and element, such as 0x300A012C.
std::string Value(std::uint32_t tag, const char* kind, std::string value) {
  if (value.empty()) return {};
  if (value.size() % 2 != 0) value += std::string_view(kind) == "UI" ? '\0' : ' ';
  std::string bytes = Tag(tag);
  const bool is_long = value.size() > kMostShort;
  const bool is_words = std::string_view(kind) == "OW";
  const std::string_view written = is_long && !is_words ? "UN" : kind;
  bytes += written;
  if (is_long || is_words || written == "OB") {
    Put16(bytes, 0);
    Put32(bytes, value.size());
  } else {
    Put16(bytes, static_cast<unsigned>(value.size()));
  }
  return bytes + value;
}

std::string Sequence(std::uint32_t tag, const std::vector<std::string>& items) {
  std::string inside;
  for (const std::string& item : items) {
    inside += Tag(0xFFFEE000);
    Put32(inside, item.size());
    inside += item;
  }
  std::string bytes = Tag(tag) + "SQ";
  Put16(bytes, 0);
  Put32(bytes, inside.size());
  return bytes + inside;
}

std::string Float(double value) {
  const auto number = static_cast<float>(value);
  std::string bytes;
  Put32(bytes, std::bit_cast<std::uint32_t>(number));
  return bytes;
}

std::string Point(const Eigen::Vector3d& p) {
  return fmt::format("{:.4f}\\{:.4f}\\{:.4f}", p.x(), p.y(), p.z());
}

/// With the preamble and the group of the file.
std::string WholeFile(const PlanningFile& file, const std::string& data) {
  std::string meta =
      Value(0x00020001, "OB", std::string("\0\1", 2)) + Value(0x00020002, "UI", file.class_uid) +
      Value(0x00020003, "UI", file.instance_uid) + Value(0x00020010, "UI", "1.2.840.10008.1.2.1") +
      Value(0x00020012, "UI", "2.25.1");
  std::string length = Tag(0x00020000) + "UL";
  Put16(length, 4);
  Put32(length, meta.size());
  return std::string(128, '\0') + "DICM" + length + meta + data;
}

std::string Head(const PlanningFile& file, const char* modality) {
  return Value(0x00080005, "CS", "ISO_IR 192") + Value(0x00080016, "UI", file.class_uid) +
         Value(0x00080018, "UI", file.instance_uid) + Value(0x00080060, "CS", modality) +
         Value(0x00100010, "PN", file.patient_name) + Value(0x00100020, "LO", file.patient_id) +
         // Archives take nothing without a study and a series.
         Value(0x0020000D, "UI", "2.25.1309") + Value(0x0020000E, "UI", file.instance_uid + ".1");
}

std::string DateOf(const PlanningFile& file) { return file.date.substr(0, 8); }
std::string TimeOf(const PlanningFile& file) {
  return file.date.size() > 9 ? file.date.substr(9) : "";
}

std::string ContourItem(const PlannedContour& contour) {
  std::string data;
  for (const Eigen::Vector3d& p : contour.points_mm) {
    if (!data.empty()) data += '\\';
    data += Point(p);
  }
  std::string item = Value(0x30060042, "CS", contour.kind);
  if (contour.stated_points >= 0)
    item += Value(0x30060046, "IS", std::to_string(contour.stated_points));
  return item + Value(0x30060050, "DS", data);
}

/// The series on which it was drawn; nothing where it names none.
std::string ImagesOf(const StructureSet& structures) {
  std::vector<std::string> all;
  for (const auto& [uid, image_uids] : structures.image_uids) {
    std::vector<std::string> images;
    for (const std::string& image : image_uids)
      images.push_back(Value(0x00081150, "UI", "1.2.840.10008.5.1.4.1.1.2") +
                       Value(0x00081155, "UI", image));
    all.push_back(Value(0x0020000E, "UI", uid) + Sequence(0x30060016, images));
  }
  if (all.empty()) return {};
  return Sequence(0x30060012, {Value(0x00081150, "UI", "1.2.840.10008.3.1.2.3.1") +
                               Value(0x00081155, "UI", "2.25.1309") + Sequence(0x30060014, all)});
}

std::string BeamItem(const PlannedBeam& beam) {
  std::string point =
      Value(0x300A0112, "IS", "0") + Value(0x300A0122, "DS", fmt::format("{:.9g}", beam.couch_deg));
  if (beam.isocentre_mm) point += Value(0x300A012C, "DS", Point(*beam.isocentre_mm));
  point += Value(0x300A0140, "FL", Float(beam.pitch_deg)) +
           Value(0x300A0144, "FL", Float(beam.roll_deg));
  std::string item =
      Value(0x300A00C0, "IS", std::to_string(beam.number)) + Value(0x300A00C2, "LO", beam.name);
  item += Sequence(0x300A0111, {point});
  if (beam.setup) item += Value(0x300C006A, "IS", std::to_string(*beam.setup));
  return item;
}

std::string Word(int value) {
  std::string bytes;
  Put16(bytes, static_cast<unsigned>(value));
  return bytes;
}

}  // namespace

std::string DicomBytes(const CtImage& image) {
  constexpr int kIntercept_hu = -1024, kMostStored = 4095;
  const PlanningFile& file = image.file;
  std::string pixels;
  for (const float hu : image.hu)
    pixels += Word(std::clamp(static_cast<int>(std::lround(hu)) - kIntercept_hu, 0, kMostStored));
  std::string head =
      Value(0x00080005, "CS", "ISO_IR 192") + Value(0x00080016, "UI", file.class_uid) +
      Value(0x00080018, "UI", file.instance_uid) + Value(0x00080060, "CS", "CT") +
      Value(0x00100010, "PN", file.patient_name) + Value(0x00100020, "LO", file.patient_id) +
      Value(0x00185100, "CS", image.position) + Value(0x0020000D, "UI", "2.25.1309") +
      Value(0x0020000E, "UI", image.series_uid) + Value(0x00200032, "DS", Point(image.origin_mm));
  const Eigen::Vector3d &x = image.along_row, &y = image.along_column;
  head += Value(0x00200037, "DS",
                fmt::format("{:g}\\{:g}\\{:g}\\{:g}\\{:g}\\{:g}", x.x(), x.y(), x.z(), y.x(), y.y(),
                            y.z())) +
          Value(0x00200052, "UI", file.frame_of_reference_uid) + Value(0x00280002, "US", Word(1)) +
          Value(0x00280004, "CS", "MONOCHROME2") + Value(0x00280010, "US", Word(image.rows)) +
          Value(0x00280011, "US", Word(image.columns)) +
          Value(0x00280030, "DS",
                fmt::format("{:.6f}\\{:.6f}", image.row_spacing_mm, image.column_spacing_mm)) +
          Value(0x00280100, "US", Word(16)) + Value(0x00280101, "US", Word(12)) +
          Value(0x00280102, "US", Word(11)) + Value(0x00280103, "US", Word(0)) +
          Value(0x00281052, "DS", std::to_string(kIntercept_hu)) + Value(0x00281053, "DS", "1");
  return WholeFile(file, head + Value(0x7FE00010, "OW", pixels));
}

std::string DicomBytes(const StructureSet& structures) {
  const PlanningFile& file = structures.file;
  std::vector<std::string> rois, contours, observations;
  for (const PlannedRoi& roi : structures.rois) {
    const std::string number = std::to_string(roi.number);
    rois.push_back(Value(0x30060022, "IS", number) +
                   Value(0x30060024, "UI", roi.frame_of_reference_uid) +
                   Value(0x30060026, "LO", roi.name));
    observations.push_back(Value(0x30060082, "IS", number) + Value(0x30060084, "IS", number) +
                           Value(0x300600A4, "CS", roi.type));
    std::vector<std::string> items;
    for (const PlannedContour& contour : roi.contours) items.push_back(ContourItem(contour));
    // As some systems do, an empty contour has no item at all.
    if (!items.empty())
      contours.push_back(Sequence(0x30060040, items) + Value(0x30060084, "IS", number));
  }
  std::string data = Head(file, "RTSTRUCT") + Value(0x30060002, "SH", file.label) +
                     Value(0x30060008, "DA", DateOf(file)) + Value(0x30060009, "TM", TimeOf(file));
  if (!file.frame_of_reference_uid.empty())
    data += Sequence(0x30060010,
                     {Value(0x00200052, "UI", file.frame_of_reference_uid) + ImagesOf(structures)});
  data += Sequence(0x30060020, rois) + Sequence(0x30060039, contours) +
          Sequence(0x30060080, observations);
  return WholeFile(file, data);
}

std::string DicomBytes(const TreatmentPlan& plan) {
  const PlanningFile& file = plan.file;
  std::vector<std::string> beams, setups;
  for (const PlannedBeam& beam : plan.beams) beams.push_back(BeamItem(beam));
  for (const PatientSetup& setup : plan.setups)
    setups.push_back(Value(0x00185100, "CS", setup.position) +
                     Value(0x300A0182, "IS", std::to_string(setup.number)) +
                     (setup.has_displacement ? Value(0x300A01D2, "DS", "12.5") : ""));
  std::string data = Head(file, "RTPLAN") + Value(0x00200052, "UI", file.frame_of_reference_uid) +
                     Value(0x300A0002, "SH", file.label) + Value(0x300A0006, "DA", DateOf(file)) +
                     Value(0x300A0007, "TM", TimeOf(file)) +
                     Value(0x300A000C, "CS", plan.geometry) + Sequence(0x300A00B0, beams) +
                     Sequence(0x300A0180, setups);
  if (!plan.structure_set_uid.empty())
    data += Sequence(0x300C0060, {Value(0x00081150, "UI", "1.2.840.10008.5.1.4.1.1.481.3") +
                                  Value(0x00081155, "UI", plan.structure_set_uid)});
  data += Value(0x300E0002, "CS", plan.approval);
  return WholeFile(file, data);
}

}  // namespace plumb
