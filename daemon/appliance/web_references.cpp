#include "daemon/appliance/web_references.hpp"

#include <utility>

#include <fmt/format.h>

#include "daemon/files/scene_folder.hpp"
#include "daemon/loop/log.hpp"

namespace plumb {

std::vector<web::Reference> WebReferences::References(const std::string& patient_id) {
  return store_.Read(&Store::references,
                     [&](ReferenceStore& references) { return references.List(patient_id); });
}

std::optional<web::Reference> WebReferences::FindReference(const std::string& id) {
  return store_.Read(&Store::references,
                     [&](ReferenceStore& references) { return references.Find(id); });
}

web::RoomOnMap WebReferences::RoomOfReference(const web::Reference& reference) {
  const std::optional<web::Scan> scan = ScanOf(reference.scan_id);
  if (!scan || scan->folder.empty()) return {};
  try {
    const auto ways = appliance_.RoomIn(ReadSceneMarkers(scan->folder / "scene"));
    if (!ways) return {};
    return {.gantry_xy = {ways->gantry.x(), ways->gantry.y()},
            .right_xy = {ways->right.x(), ways->right.y()},
            .is_known = true};
  } catch (const std::exception& error) {
    Log(LogLevel::kNotice, fmt::format("no room for reference {}: {}", reference.id, error.what()));
    return {};
  }
}

std::optional<web::Scan> WebReferences::ScanOf(const std::string& scan_id) {
  return store_.Read(&Store::scans, [&](ScanStore& scans) { return scans.Find(scan_id); });
}

void WebReferences::AddReference(const web::Actor& actor, const std::string& scan_id,
                                 const std::string& reason, web::Done done) {
  const std::optional<web::Scan> scan = ScanOf(scan_id);
  if (const std::string why = appliance_.WhyNoReference(scan); !why.empty())
    return done(AnswerOf(why));
  store_.Change(&Store::references, std::move(done),
                [=, appliance = &appliance_](ReferenceStore& references) {
                  return references.Add(actor, scan_id, reason, appliance->DefaultPlan());
                });
}

void WebReferences::PlanReference(const web::Actor& actor, const std::string& id, int revision,
                                  const web::ReferencePlan& plan, web::Done done) {
  store_.Change(&Store::references, std::move(done), [=](ReferenceStore& references) {
    const std::string planned = references.Plan(actor, id, revision, plan);
    return planned == id ? std::string() : planned;  // only a new version was made
  });
}

void WebReferences::ApproveReference(const web::Actor& actor, const std::string& id, int revision,
                                     const std::string& digest, web::Done done) {
  const std::optional<web::Reference> reference = FindReference(id);
  const std::optional<web::Scan> scan =
      reference ? ScanOf(reference->scan_id) : std::optional<web::Scan>();
  if (const std::string why = appliance_.WhyNoReference(scan); !why.empty())
    return done(AnswerOf(why));
  store_.Change(&Store::references, std::move(done), [=](ReferenceStore& references) {
    references.Approve(actor, id, revision, digest);
  });
}

}  // namespace plumb
