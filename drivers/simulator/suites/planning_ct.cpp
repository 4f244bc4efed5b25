// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/suites/planning_ct.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <set>

namespace plumb::simulated {
namespace {

using Eigen::Vector3d;
using Loop = std::vector<Vector3d>;
using Edge = std::pair<std::uint32_t, std::uint32_t>;

constexpr const char* kStructuresClass = "1.2.840.10008.5.1.4.1.1.481.3";
constexpr const char* kPlanClass = "1.2.840.10008.5.1.4.1.1.481.5";

/// Where the plane y = `y` cuts a closed mesh, as closed loops.
std::vector<Loop> Cut(const std::vector<Vector3d>& vertices,
                      const std::vector<std::array<std::uint32_t, 3>>& triangles, double y) {
  std::map<Edge, std::vector<Edge>> neighbours;
  for (const auto& triangle : triangles) {
    std::vector<Edge> crossed;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[k], b = triangle[(k + 1) % 3];
      if ((vertices[a].y() > y) != (vertices[b].y() > y))
        crossed.emplace_back(std::min(a, b), std::max(a, b));
    }
    if (crossed.size() != 2) continue;
    neighbours[crossed[0]].push_back(crossed[1]);
    neighbours[crossed[1]].push_back(crossed[0]);
  }
  std::vector<Loop> loops;
  std::set<Edge> seen;
  for (const auto& [start, unused] : neighbours) {
    Loop loop;
    Edge at = start;
    while (seen.insert(at).second) {
      const Vector3d &a = vertices[at.first], &b = vertices[at.second];
      loop.push_back(a + (y - a.y()) / (b.y() - a.y()) * (b - a));
      for (const Edge& next : neighbours[at]) {
        if (seen.contains(next)) continue;
        at = next;
        break;
      }
    }
    if (loop.size() >= 3) loops.push_back(std::move(loop));
  }
  return loops;
}

class CtMaker {
 public:
  CtMaker(const TriangleMesh& surface, const Pose& T_iec_surface, const PlanningCtOptions& options)
      : options_(options), triangles_(surface.triangles) {
    for (std::size_t i = 0; i < surface.vertices.size(); ++i) {
      Vector3d p = surface.vertices[i].cast<double>();
      if (options.skin_m != 0) p += options.skin_m * surface.normals[i].cast<double>();
      vertices_.push_back(T_iec_surface * p);
    }
  }

  std::pair<StructureSet, TreatmentPlan> Make() {
    structures_.file = {.class_uid = kStructuresClass,
                        .instance_uid = "2.25.481.3",
                        .patient_id = "SIM-1",
                        .patient_name = "Simulated^Body",
                        .label = "CT",
                        .date = "20260101 080000",
                        .frame_of_reference_uid = "2.25.52"};
    PlannedRoi& body = structures_.rois.emplace_back();
    body = {.number = 1, .name = "BODY", .type = "EXTERNAL", .frame_of_reference_uid = "2.25.52"};
    PlannedRoi organ = {
        .number = 2, .name = "Heart", .type = "ORGAN", .frame_of_reference_uid = "2.25.52"};
    AddSlices(body, organ);
    structures_.rois.push_back(std::move(organ));
    MakePlan();
    AddQuirksOfRois();
    AddQuirksOfFiles();
    return {std::move(structures_), std::move(plan_)};
  }

 private:
  [[nodiscard]] bool Has(CtQuirk quirk) const {
    return std::find(options_.quirks.begin(), options_.quirks.end(), quirk) !=
           options_.quirks.end();
  }

  void Add(PlannedRoi& roi, const Loop& loop, const char* kind = "CLOSED_PLANAR") const {
    PlannedContour& contour = roi.contours.emplace_back();
    contour.kind = kind;
    for (const Vector3d& p : loop)
      contour.points_mm.push_back(PatientOf(options_.posture, p / kMillimetre) +
                                  options_.isocentre_mm);
    if (Has(CtQuirk::kClosed)) contour.points_mm.push_back(contour.points_mm.front());
    contour.stated_points = static_cast<std::int64_t>(contour.points_mm.size());
  }

  static Loop Square(double x, double y, double z, double side) {
    return {{x, y, z}, {x + side, y, z}, {x + side, y, z + side}, {x, y, z + side}};
  }

  /// Distance of the nearest corner.
  static double Nearest(const Loop& loop, const Vector3d& from) {
    double nearest = std::numeric_limits<double>::max();
    for (const Vector3d& p : loop) nearest = std::min(nearest, (p - from).norm());
    return nearest;
  }

  static Loop Densified(const Loop& loop, std::size_t factor) {
    Loop dense;
    for (std::size_t i = 0; i < loop.size(); ++i) {
      for (std::size_t k = 0; k < factor; ++k)
        dense.push_back(loop[i] + static_cast<double>(k) / static_cast<double>(factor) *
                                      (loop[(i + 1) % loop.size()] - loop[i]));
    }
    return dense;
  }

  void AddSlice(double y, PlannedRoi& body, PlannedRoi& organ) const {
    for (const Loop& loop : Cut(vertices_, triangles_, y)) {
      if (Has(CtQuirk::kCrumbs)) Add(body, Square(low_.x() - 0.02, y, high_.z() + 0.05, 0.005));
      Add(body, Has(CtQuirk::kDense) ? Densified(loop, 1 + 3000 / loop.size()) : loop);
      Vector3d middle = Vector3d::Zero();
      for (const Vector3d& p : loop) middle += p / static_cast<double>(loop.size());
      Add(organ, Square(middle.x(), y, middle.z(), 0.02));
      if (Has(CtQuirk::kHoles) && Nearest(loop, middle) > 0.04)
        Add(body, Square(middle.x(), y, middle.z() - 0.02, 0.015));
    }
    if (Has(CtQuirk::kCouchParts)) {
      for (const double x : {low_.x() - 0.06, high_.x() + 0.03})
        Add(body, {{x, y, low_.z()},
                   {x + 0.06, y, low_.z()},
                   {x + 0.06, y, low_.z() + 0.011},
                   {x, y, low_.z() + 0.011}});
    }
    if (Has(CtQuirk::kCouch)) {
      const double z = low_.z(), x = low_.x() - 0.1, X = high_.x() + 0.1;
      Add(body, {{x, y, z - 0.05}, {X, y, z - 0.05}, {X, y, z}, {x, y, z}});
    }
    if (Has(CtQuirk::kPoints)) {
      Add(body, {{0, y, 0}}, "POINT");
      Add(body, {{0, y, 0}, {0.1, y, 0.3}});
    }
  }

  void AddSlices(PlannedRoi& body, PlannedRoi& organ) {
    low_ = Vector3d::Constant(std::numeric_limits<double>::max());
    high_ = -low_;
    for (const Vector3d& p : vertices_) {
      low_ = low_.cwiseMin(p);
      high_ = high_.cwiseMax(p);
    }
    const double spacing = options_.spacing_m;
    const auto first = static_cast<int>(std::ceil(low_.y() / spacing - options_.phase));
    const auto last = static_cast<int>(std::floor(high_.y() / spacing - options_.phase));
    for (int i = first; i <= last; ++i) {
      if (Has(CtQuirk::kShort) && std::abs((i + options_.phase) * spacing) > 0.15) continue;
      if (Has(CtQuirk::kMissingSlice) && i == (first + last) / 2) continue;
      AddSlice((i + options_.phase) * spacing, body, organ);
    }
  }

  void MakePlan() {
    plan_.file = structures_.file;
    plan_.file.class_uid = kPlanClass;
    plan_.file.instance_uid = "2.25.481.5";
    plan_.file.label = "SIM";
    plan_.geometry = "PATIENT";
    plan_.approval = "APPROVED";
    plan_.structure_set_uid = structures_.file.instance_uid;
    plan_.setups = {{.number = 1, .position = std::string(Name(options_.posture))}};
    plan_.beams = {{.number = 1, .name = "AP", .setup = 1, .isocentre_mm = options_.isocentre_mm},
                   {.number = 2,
                    .name = "LAT",
                    .setup = 1,
                    .isocentre_mm = options_.isocentre_mm,
                    .couch_deg = 8.4737e-10}};
  }

  void AddQuirksOfRois() {
    std::vector<PlannedRoi>& rois = structures_.rois;
    if (Has(CtQuirk::kEmptyRoi))
      rois.insert(
          rois.begin(),
          {.number = 7, .name = "Skin", .type = "EXTERNAL", .frame_of_reference_uid = "2.25.52"});
    PlannedRoi& body = *std::find_if(rois.begin(), rois.end(),
                                     [](const PlannedRoi& roi) { return roi.name == "BODY"; });
    if (Has(CtQuirk::kNoExternal)) body.type.clear();
    if (Has(CtQuirk::kOblique)) body.contours.front().points_mm.front().z() += 0.2;
    if (Has(CtQuirk::kLostPoints)) body.contours.front().points_mm.pop_back();
    if (Has(CtQuirk::kSeveralExternal)) {
      PlannedRoi other = rois.back();
      other.number = 8;
      other.name = "Outer";
      other.type = "EXTERNAL";
      rois.push_back(std::move(other));
    }
  }

  void AddQuirksOfFiles() {
    if (Has(CtQuirk::kDecubitus)) plan_.setups.front().position = "HFDL";
    if (Has(CtQuirk::kTwoPositions)) plan_.setups.push_back({.number = 2, .position = "FFP"});
    if (Has(CtQuirk::kTwoIsocentres)) plan_.beams.back().isocentre_mm->x() += 20;
    if (Has(CtQuirk::kOtherFrame)) plan_.file.frame_of_reference_uid = "2.25.53";
    if (Has(CtQuirk::kOtherPatient)) plan_.file.patient_id = "SIM-2";
    if (Has(CtQuirk::kSuperseded)) plan_.structure_set_uid = "2.25.481.2";
    if (Has(CtQuirk::kRejected)) plan_.approval = "REJECTED";
    if (Has(CtQuirk::kWrongPosition)) {
      const bool head = plan_.setups.front().position.starts_with('H');
      plan_.setups.front().position[0] = head ? 'F' : 'H';
    }
  }

  const PlanningCtOptions& options_;
  std::vector<Vector3d> vertices_;
  const std::vector<std::array<std::uint32_t, 3>>& triangles_;
  Vector3d low_ = Vector3d::Zero(), high_ = Vector3d::Zero();
  StructureSet structures_;
  TreatmentPlan plan_;
};

}  // namespace

Vector3d PatientOf(PatientPosture posture, const Vector3d& iec) {
  switch (posture) {
    case PatientPosture::kHeadFirstSupine:
      return {iec.x(), -iec.z(), iec.y()};
    case PatientPosture::kHeadFirstProne:
      return {-iec.x(), iec.z(), iec.y()};
    case PatientPosture::kFeetFirstSupine:
      return {-iec.x(), -iec.z(), -iec.y()};
    case PatientPosture::kFeetFirstProne:
      return {iec.x(), iec.z(), -iec.y()};
  }
  return iec;
}

std::pair<StructureSet, TreatmentPlan> MakePlanningCt(const TriangleMesh& surface,
                                                      const Pose& T_iec_surface,
                                                      const PlanningCtOptions& options) {
  return CtMaker(surface, T_iec_surface, options).Make();
}

}  // namespace plumb::simulated
