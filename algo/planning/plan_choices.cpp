// SPDX-License-Identifier: Apache-2.0
#include "algo/planning/plan_choices.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/errors.hpp"
#include "algo/planning/contour_surface.hpp"
#include "algo/planning/iec_axes.hpp"
#include "words/planning.hpp"

namespace plumb {
namespace {

constexpr double kSame_mm = 0.01;
constexpr double kLevel_deg = 0.05;

bool HasContours(const PlannedRoi& roi) {
  return std::any_of(roi.contours.begin(), roi.contours.end(), [](const PlannedContour& contour) {
    return contour.kind == "CLOSED_PLANAR" && contour.points_mm.size() >= 3;
  });
}

/// Sum of the areas, by which a body is larger than an organ.
double SizeOf(const PlannedRoi& roi) {
  double sum = 0.0;
  for (const PlannedContour& contour : roi.contours) {
    if (contour.points_mm.size() >= 3) sum += AreaOf(InPlane(contour.points_mm));
  }
  return sum;
}

std::vector<std::string> NamesOf(const std::vector<const PlannedRoi*>& rois) {
  std::vector<std::string> names;
  for (const PlannedRoi* roi : rois) names.push_back(roi->name);
  return names;
}

const PlannedRoi& Largest(const std::vector<const PlannedRoi*>& rois) {
  return **std::max_element(rois.begin(), rois.end(),
                            [](const auto* a, const auto* b) { return SizeOf(*a) < SizeOf(*b); });
}

bool SoundsLikeABody(const std::string& name) {
  const std::string lower = AsciiLower(name);
  constexpr std::array<const char*, 5> kUsual = {"body", "external", "skin", "patient", "outer"};
  return std::any_of(kUsual.begin(), kUsual.end(),
                     [&](const char* usual) { return lower.find(usual) != std::string::npos; });
}

const PlannedRoi& RoiOfName(const std::vector<const PlannedRoi*>& filled,
                            const StructureSet& structures, const std::string& name) {
  std::vector<const PlannedRoi*> named;
  for (const PlannedRoi& roi : structures.rois)
    if (roi.name == name) named.push_back(&roi);
  if (named.empty()) throw DataError(say::planning::NoSuchRoi(name, NamesOf(filled)));
  if (named.size() > 1) throw DataError(say::planning::RoiTwice(name));
  if (!HasContours(*named.front())) throw DataError(say::planning::RoiEmpty(name));
  return *named.front();
}

/// The position that all setups state.
PatientPosture PostureOf(const TreatmentPlan& plan) {
  std::set<std::string> positions;
  for (const PatientSetup& setup : plan.setups)
    if (!setup.position.empty()) positions.insert(setup.position);
  if (positions.empty()) throw DataError(say::planning::PositionMissing());
  if (positions.size() > 1)
    throw DataError(say::planning::PositionsDiffer({positions.begin(), positions.end()}));
  const std::optional<PatientPosture> posture = PostureOfPosition(*positions.begin());
  if (!posture) throw DataError(say::planning::PositionRefused(*positions.begin()));
  return *posture;
}

std::vector<std::string> NamesOf(const std::vector<PlannedBeam>& beams) {
  std::vector<std::string> names;
  for (const PlannedBeam& beam : beams) names.push_back(beam.name);
  return names;
}

bool ShareIsocentre(const std::vector<const PlannedBeam*>& beams) {
  return std::all_of(beams.begin(), beams.end(), [&](const PlannedBeam* beam) {
    return (*beam->isocentre_mm - *beams.front()->isocentre_mm).norm() <= kSame_mm;
  });
}

bool HasItsNameAlone(const TreatmentPlan& plan, const PlannedBeam& beam) {
  return std::count_if(plan.beams.begin(), plan.beams.end(),
                       [&](const PlannedBeam& other) { return other.name == beam.name; }) == 1;
}

/// Those that a choice may mean. A beam's name may be the number of another: names count first, and
/// a number beside them only if its beam shares its own name and so can be called in no other way.
std::vector<const PlannedBeam*> BeamsCalled(const TreatmentPlan& plan, const std::string& choice) {
  std::vector<const PlannedBeam*> called;
  for (const PlannedBeam& beam : plan.beams)
    if (beam.name == choice) called.push_back(&beam);
  const bool is_name = !called.empty();
  for (const PlannedBeam& beam : plan.beams) {
    if (std::to_string(beam.number) != choice || beam.name == choice) continue;
    if (!is_name || !HasItsNameAlone(plan, beam)) called.push_back(&beam);
  }
  return called;
}

/// The beam whose isocentre counts; nothing chosen: one for all if they agree.
const PlannedBeam& BeamOf(const TreatmentPlan& plan, const std::optional<std::string>& choice) {
  std::vector<const PlannedBeam*> beams;
  if (choice) {
    beams = BeamsCalled(plan, *choice);
    if (beams.empty()) throw DataError(say::planning::NoSuchBeam(*choice, NamesOf(plan.beams)));
  } else {
    for (const PlannedBeam& beam : plan.beams) beams.push_back(&beam);
  }
  std::erase_if(beams, [](const PlannedBeam* beam) { return !beam->isocentre_mm; });
  if (beams.empty())
    throw DataError(choice ? say::planning::BeamWithoutIsocentre(*choice)
                           : say::planning::NoIsocentre());
  if (ShareIsocentre(beams)) return *beams.front();
  if (!choice) throw DataError(say::planning::SeveralIsocentres(NamesOf(plan.beams)));
  std::vector<std::string> numbers;
  for (const PlannedBeam* beam : beams) numbers.push_back(std::to_string(beam->number));
  throw DataError(say::planning::BeamTwice(*choice, numbers));
}

void CheckCouch(const TreatmentPlan& plan, std::vector<Message>& warnings) {
  for (const PlannedBeam& beam : plan.beams) {
    if (!(std::abs(beam.pitch_deg) <= kLevel_deg && std::abs(beam.roll_deg) <= kLevel_deg))
      throw DataError(say::planning::CouchTilted(beam.name, beam.pitch_deg, beam.roll_deg));
  }
  for (const PlannedBeam& beam : plan.beams) {
    if (std::abs(std::remainder(beam.couch_deg, 360.0)) > kLevel_deg) {
      warnings.push_back(say::planning::CouchTurns(beam.name, beam.couch_deg));
      break;
    }
  }
  for (const PatientSetup& setup : plan.setups) {
    if (setup.has_displacement) {
      warnings.push_back(say::planning::Displacement());
      break;
    }
  }
}

}  // namespace

void RequireOnePatient(const StructureSet& structures, const TreatmentPlan& plan) {
  if (structures.file.patient_id != plan.file.patient_id ||
      (plan.file.patient_id.empty() && structures.file.patient_name != plan.file.patient_name))
    throw DataError(say::planning::OtherPatient());
}

void RequireUsablePlan(const TreatmentPlan& plan, std::vector<Message>& warnings) {
  if (plan.geometry != "PATIENT") throw DataError(say::planning::Geometry(plan.geometry));
  if (plan.approval == "REJECTED") throw DataError(say::planning::Rejected());
  if (plan.approval == "UNAPPROVED") warnings.push_back(say::planning::Unapproved());
}

void RequireUsablePlan(const StructureSet& structures, const TreatmentPlan& plan,
                       std::vector<Message>& warnings) {
  RequireUsablePlan(plan, warnings);
  if (plan.structure_set_uid != structures.file.instance_uid)
    throw DataError(
        say::planning::Superseded(plan.structure_set_uid, structures.file.instance_uid));
}

void RequireImagesOfPlan(const CtSkin& images, const TreatmentPlan& plan,
                         PatientPosture planned_posture) {
  const PlanningFile &image = images.file(), &planned = plan.file;
  if (image.patient_id != planned.patient_id ||
      (planned.patient_id.empty() && image.patient_name != planned.patient_name))
    throw DataError(say::planning::ImagesOtherPatient());
  const std::string posture(Name(planned_posture));
  if (!images.position().empty() && images.position() != posture)
    throw DataError(say::planning::ImagesPosition(images.position(), posture));
}

void RequireOneFrame(const StructureSet& structures, const PlannedRoi& roi,
                     const TreatmentPlan& plan) {
  std::string known;
  for (const std::string* uid : {&plan.file.frame_of_reference_uid, &roi.frame_of_reference_uid,
                                 &structures.file.frame_of_reference_uid}) {
    if (uid->empty()) continue;
    if (known.empty()) known = *uid;
    if (*uid != known) throw DataError(say::planning::OtherFrame(known, *uid));
  }
  const bool stated =
      !roi.frame_of_reference_uid.empty() || !structures.file.frame_of_reference_uid.empty();
  if (plan.file.frame_of_reference_uid.empty() || !stated)
    throw DataError(say::planning::FrameMissing());
}

PlannedPlace ChoosePlace(const TreatmentPlan& plan, const std::optional<std::string>& beam,
                         std::vector<Message>& warnings) {
  PlannedPlace place;
  place.posture = PostureOf(plan);
  const PlannedBeam& chosen = BeamOf(plan, beam);
  place.isocentre_mm = *chosen.isocentre_mm;
  if (beam) place.beam = chosen.name;
  if (beam && !HasItsNameAlone(plan, chosen)) place.beam += fmt::format(" ({})", chosen.number);
  CheckCouch(plan, warnings);
  return place;
}

bool HasExternal(const StructureSet& structures) {
  return std::any_of(structures.rois.begin(), structures.rois.end(), [](const PlannedRoi& roi) {
    return roi.type == "EXTERNAL" && HasContours(roi);
  });
}

const PlannedRoi& ChooseRoi(const StructureSet& structures,
                            const std::optional<std::string>& name) {
  std::vector<const PlannedRoi*> filled, external, sounding;
  for (const PlannedRoi& roi : structures.rois) {
    if (!HasContours(roi)) continue;
    filled.push_back(&roi);
    if (roi.type == "EXTERNAL") external.push_back(&roi);
    if (SoundsLikeABody(roi.name)) sounding.push_back(&roi);
  }
  if (filled.empty()) throw DataError(say::planning::NoContours());
  if (name) return RoiOfName(filled, structures, *name);
  if (external.size() == 1) return *external.front();
  if (external.size() > 1)
    throw DataError(say::planning::SeveralExternal(NamesOf(external), Largest(external).name));
  throw DataError(sounding.empty()
                      ? say::planning::NoExternal(NamesOf(filled))
                      : say::planning::NoExternalPerhaps(NamesOf(filled), Largest(sounding).name));
}

}  // namespace plumb
