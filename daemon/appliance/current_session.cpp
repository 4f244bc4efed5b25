// SPDX-License-Identifier: Apache-2.0
#include "daemon/appliance/current_session.hpp"

#include <utility>

#include "daemon/database/stored_values.hpp"
#include "words/scan.hpp"

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
  confirmed_.reset();
  ArmTimer();
}

void CurrentSession::Forget() {
  id_.clear();
  patient_id_.clear();
  reason_.clear();
  confirmed_.reset();
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

bool CurrentSession::LacksWristband(std::chrono::steady_clock::time_point now) const {
  const bool is_of_patient = IsOpen() && opened_by_.user != kSelf.user && !check_;
  return is_of_patient && !(confirmed_ && now - *confirmed_ < kWristbandHolds);
}

void CurrentSession::UseUpWristband() {
  if (!check_) confirmed_.reset();
}

Message CurrentSession::WhyNotChange() const {
  if (opening_) return say::scan::OpeningPatient();
  if (wiping_) return say::scan::RemovingPatient();
  return {};
}

Message CurrentSession::WhyNotScan() const {
  if (opening_) return say::scan::PressAfterOpening();
  if (wiping_) return say::scan::PressAfterRemoving();
  return {};
}

}  // namespace plumb
