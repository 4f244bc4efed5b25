// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/planning_wire.hpp"

#include <cmath>

#include <nlohmann/json.hpp>

#include "algo/base/bounded_json.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/message_json.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

using Json = nlohmann::ordered_json;

template <typename T>
Json OrNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json Written(const PlanningFile& file) {
  return {{"class_uid", file.class_uid},
          {"instance_uid", file.instance_uid},
          {"patient_id", file.patient_id},
          {"patient_name", file.patient_name},
          {"label", file.label},
          {"date", file.date},
          {"frame", file.frame_of_reference_uid}};
}

PlanningFile FileOf(const Json& json) {
  return {.class_uid = json.at("class_uid").get<std::string>(),
          .instance_uid = json.at("instance_uid").get<std::string>(),
          .patient_id = json.at("patient_id").get<std::string>(),
          .patient_name = json.at("patient_name").get<std::string>(),
          .label = json.at("label").get<std::string>(),
          .date = json.at("date").get<std::string>(),
          .frame_of_reference_uid = json.at("frame").get<std::string>()};
}

Json Written(const StructureSet& structures) {
  Json rois = Json::array();
  for (const PlannedRoi& roi : structures.rois) {
    Json contours = Json::array();
    for (const PlannedContour& contour : roi.contours)
      contours.push_back({contour.kind, contour.stated_points, contour.points_mm.size()});
    rois.push_back({{"number", roi.number},
                    {"name", roi.name},
                    {"type", roi.type},
                    {"frame", roi.frame_of_reference_uid},
                    {"contours", std::move(contours)}});
  }
  return rois;
}

StructureSet StructuresOf(const Json& rois, std::span<const double> numbers) {
  StructureSet structures;
  for (const Json& json : rois) {
    PlannedRoi& roi = structures.rois.emplace_back();
    roi.number = json.at("number").get<std::int64_t>();
    roi.name = json.at("name").get<std::string>();
    roi.type = json.at("type").get<std::string>();
    roi.frame_of_reference_uid = json.at("frame").get<std::string>();
    for (const Json& stated : json.at("contours")) {
      PlannedContour& contour = roi.contours.emplace_back();
      contour.kind = stated.at(0).get<std::string>();
      contour.stated_points = stated.at(1).get<std::int64_t>();
      const auto count = stated.at(2).get<std::uint64_t>();
      if (count > numbers.size() / 3) throw DataError(say::dicom::ReaderVersion());
      for (std::size_t i = 0; i < 3 * count; i += 3)
        contour.points_mm.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
      numbers = numbers.subspan(3 * count);
    }
  }
  if (!numbers.empty()) throw DataError(say::dicom::ReaderVersion());
  return structures;
}

Json Written(const TreatmentPlan& plan) {
  Json setups = Json::array(), beams = Json::array();
  for (const PatientSetup& setup : plan.setups)
    setups.push_back({{"number", setup.number},
                      {"position", setup.position},
                      {"has_displacement", setup.has_displacement}});
  for (const PlannedBeam& beam : plan.beams) {
    Json isocentre = nullptr;
    if (const auto& p = beam.isocentre_mm) isocentre = {p->x(), p->y(), p->z()};
    beams.push_back({{"number", beam.number},
                     {"name", beam.name},
                     {"setup", OrNull(beam.setup)},
                     {"isocentre_mm", std::move(isocentre)},
                     {"couch_deg", beam.couch_deg},
                     {"pitch_deg", beam.pitch_deg},
                     {"roll_deg", beam.roll_deg}});
  }
  return {{"geometry", plan.geometry},
          {"approval", plan.approval},
          {"structure_set_uid", plan.structure_set_uid},
          {"setups", std::move(setups)},
          {"beams", std::move(beams)}};
}

PlannedBeam BeamOf(const Json& json) {
  PlannedBeam beam;
  beam.number = json.at("number").get<std::int64_t>();
  beam.name = json.at("name").get<std::string>();
  if (!json.at("setup").is_null()) beam.setup = json["setup"].get<std::int64_t>();
  if (const Json& p = json.at("isocentre_mm"); !p.is_null())
    beam.isocentre_mm =
        Eigen::Vector3d(p.at(0).get<double>(), p.at(1).get<double>(), p.at(2).get<double>());
  beam.couch_deg = json.at("couch_deg").get<double>();
  beam.pitch_deg = json.at("pitch_deg").get<double>();
  beam.roll_deg = json.at("roll_deg").get<double>();
  return beam;
}

TreatmentPlan PlanOf(const Json& json) {
  TreatmentPlan plan;
  plan.geometry = json.at("geometry").get<std::string>();
  plan.approval = json.at("approval").get<std::string>();
  plan.structure_set_uid = json.at("structure_set_uid").get<std::string>();
  for (const Json& setup : json.at("setups"))
    plan.setups.push_back({.number = setup.at("number").get<std::int64_t>(),
                           .position = setup.at("position").get<std::string>(),
                           .has_displacement = setup.at("has_displacement").get<bool>()});
  for (const Json& beam : json.at("beams")) plan.beams.push_back(BeamOf(beam));
  return plan;
}

Json Written(const CtImage& image) {
  const auto written = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  return {{"series_uid", image.series_uid},
          {"position", image.position},
          {"rows", image.rows},
          {"columns", image.columns},
          {"origin_mm", written(image.origin_mm)},
          {"along_row", written(image.along_row)},
          {"along_column", written(image.along_column)},
          {"column_spacing_mm", image.column_spacing_mm},
          {"row_spacing_mm", image.row_spacing_mm}};
}

CtImage ImageOf(const Json& json, std::span<const double> numbers) {
  const auto vector = [&](const char* key) {
    const Json& v = json.at(key);
    return Eigen::Vector3d(v.at(0).get<double>(), v.at(1).get<double>(), v.at(2).get<double>());
  };
  CtImage image{.file = {},
                .series_uid = json.at("series_uid").get<std::string>(),
                .position = json.at("position").get<std::string>(),
                .rows = json.at("rows").get<int>(),
                .columns = json.at("columns").get<int>(),
                .origin_mm = vector("origin_mm"),
                .along_row = vector("along_row"),
                .along_column = vector("along_column"),
                .column_spacing_mm = json.at("column_spacing_mm").get<double>(),
                .row_spacing_mm = json.at("row_spacing_mm").get<double>(),
                .hu = {}};
  const auto is_side = [](int side) { return side > 0 && side <= kMostImageSide; };
  if (!is_side(image.rows) || !is_side(image.columns) ||
      numbers.size() !=
          static_cast<std::size_t>(image.rows) * static_cast<std::size_t>(image.columns))
    throw DataError(say::dicom::ReaderVersion());
  image.hu.assign(numbers.begin(), numbers.end());
  return image;
}

}  // namespace

std::string FactsOf(const PlanningContent& content) {
  Json json = {{"file", Written(content.file)}, {"modality", content.modality}};
  if (content.structures) {
    json["rois"] = Written(*content.structures);
    json["image_uids"] = content.structures->image_uids;
  }
  if (content.plan) json["plan"] = Written(*content.plan);
  if (content.image) json["image"] = Written(*content.image);
  if (!content.image_fault.empty())
    json["image_fault"] = {{"english", content.image_fault.English()},
                           {"message", MessageJson(content.image_fault)}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::vector<double> PointsOf(const PlanningContent& content) {
  std::vector<double> numbers;
  if (content.image) numbers.assign(content.image->hu.begin(), content.image->hu.end());
  if (!content.structures) return numbers;
  for (const PlannedRoi& roi : content.structures->rois) {
    for (const PlannedContour& contour : roi.contours)
      for (const Eigen::Vector3d& p : contour.points_mm)
        numbers.insert(numbers.end(), {p.x(), p.y(), p.z()});
  }
  return numbers;
}

PlanningContent ParsePlanning(std::string_view facts, std::span<const double> points) {
  try {
    const Json json = ParseBoundedJson<Json>(facts);
    PlanningContent content;
    content.file = FileOf(json.at("file"));
    content.modality = json.at("modality").get<std::string>();
    for (const double number : points)
      if (!std::isfinite(number)) throw DataError(say::dicom::ReaderVersion());
    if (json.contains("rois")) {
      content.structures = StructuresOf(json["rois"], points);
      content.structures->file = content.file;
      content.structures->image_uids =
          json.at("image_uids").get<decltype(StructureSet::image_uids)>();
    }
    if (json.contains("plan")) {
      content.plan = PlanOf(json["plan"]);
      content.plan->file = content.file;
    }
    if (json.contains("image")) {
      content.image = ImageOf(json["image"], points);
      content.image->file = content.file;
    }
    if (json.contains("image_fault"))
      content.image_fault = MessageFromJson(json["image_fault"].at("message"),
                                            json["image_fault"].at("english").get<std::string>());
    return content;
  } catch (const nlohmann::json::exception&) {
    throw DataError(say::dicom::ReaderVersion());
  }
}

}  // namespace plumb
