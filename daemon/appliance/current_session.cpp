#include "daemon/appliance/current_session.hpp"

#include <utility>

#include "daemon/records/stored_values.hpp"

namespace plumb {

CurrentSession::CurrentSession(EventLoop& loop, const Config& config, std::function<void()> unused)
    : config_(config), timer_(loop.MakeTimer("session unused", std::move(unused))) {}

void CurrentSession::Open(const std::string& id, const std::string& patient_id, ScanPurpose purpose,
                          const std::string& reason, const Actor& actor) {
  id_ = id;
  patient_id_ = patient_id;
  opened_by_ = actor;
  check_.reset();
  purpose_ = purpose;
  reason_ = reason;
  ArmTimer();
}

void CurrentSession::Forget() {
  id_.clear();
  patient_id_.clear();
  reason_.clear();
  purpose_ = ScanPurpose::kFraction;
  timer_.Disarm();
}

void CurrentSession::ArmTimer() {
  if (!IsOpen() || opened_by_.user == kSelf.user) return timer_.Disarm();
  timer_.ArmAfterSeconds(60 * config_.appliance.session_idle_min);
}

bool CurrentSession::IsPatients() const {
  return opening_ || (IsOpen() && opened_by_.user != kSelf.user);
}

std::string CurrentSession::WhyNotChange() const {
  if (opening_) return "a patient is being opened: try again in a moment";
  if (wiping_) return "this patient's data is being removed: try again in a moment";
  return {};
}

std::string CurrentSession::WhyNotScan() const {
  if (opening_) return "a patient is being opened: press again in a moment";
  if (wiping_) return "this patient's data is being removed: press again in a moment";
  return {};
}

}  // namespace plumb
