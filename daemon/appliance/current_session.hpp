// SPDX-License-Identifier: Apache-2.0
// To whom the next scan belongs and what it is for: the treatment session that is open, and the
// daily check.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <utility>

#include "algo/base/message.hpp"
#include "daemon/config/config.hpp"
#include "daemon/loop/event_loop.hpp"
#include "web/model/account.hpp"
#include "web/model/scan.hpp"

namespace plumb {

/// Nobody lies on the couch for longer before the first sweep; somebody else might by then.
inline constexpr std::chrono::minutes kWristbandHolds{10};

/// Used on the loop's thread.
class CurrentSession {
 public:
  /// The loop and the configuration are borrowed.
  /// @param unused  Called when nothing was scanned for the configured time.
  CurrentSession(EventLoop& loop, const Config& config, std::function<void()> unused);

  /// A session that the store has opened: scans belong to it until it is forgotten.
  void Open(const std::string& id, const std::string& patient_id, ScanPurpose purpose,
            const std::string& reason, const Actor& actor);
  void Forget();
  /// Restarts the timer that closes a session without scans. The demo's session does not expire,
  /// because no user could open it again.
  void ArmTimer();
  [[nodiscard]] bool IsOpen() const { return !id_.empty(); }
  [[nodiscard]] const std::string& id() const { return id_; }
  [[nodiscard]] const std::string& patient_id() const { return patient_id_; }
  [[nodiscard]] const std::string& reason() const { return reason_; }
  [[nodiscard]] const Actor& opened_by() const { return opened_by_; }
  /// Whether a patient's session is open or being opened; the demo's own does not count.
  [[nodiscard]] bool IsPatients() const;

  /// Until the store has opened a session, no scan begins, and no session is opened or closed.
  void SetOpening(bool opening) { opening_ = opening; }
  /// The same while the store removes the data of the patient whose session is open.
  void SetWiping(bool wiping) { wiping_ = wiping; }
  /// Why no session can be opened or closed at the moment, because the store and the page could end
  /// up with different ones; empty: one can.
  [[nodiscard]] Message WhyNotChange() const;
  [[nodiscard]] Message WhyNotScan() const;
  /// Asked before each scan and each opening of a patient: returns a reason why none may begin now,
  /// or nothing.
  void SetBlockingReason(std::function<Message()> blocking_reason) {
    blocking_reason_ = std::move(blocking_reason);
  }
  [[nodiscard]] Message WhyBlocked() const {
    return blocking_reason_ ? blocking_reason_() : Message();
  }

  /// The wristband of the open session's patient has been scanned: for one sweep, that begins
  /// within kWristbandHolds. Whoever opens a session, this one included, has confirmed nothing yet.
  void ConfirmWristband(std::chrono::steady_clock::time_point now) { confirmed_ = now; }
  /// Whether that has to come first, where the settings ask for it before each sweep. Not for a
  /// daily check, nor for scans without a patient.
  [[nodiscard]] bool LacksWristband(std::chrono::steady_clock::time_point now) const;
  /// Ends what was confirmed, if the next sweep is one of the session.
  void UseUpWristband();

  /// The next scan is the daily check of the room's markers; scans after it belong to the open
  /// patient again.
  void SetCheck(std::optional<Actor> actor) { check_ = std::move(actor); }
  /// The user who has asked for it; not set if the next or running scan is no check.
  [[nodiscard]] const std::optional<Actor>& check() const { return check_; }
  /// Of the next scan.
  [[nodiscard]] ScanPurpose purpose() const { return check_ ? ScanPurpose::kDailyCheck : purpose_; }

 private:
  const Config& config_;
  std::string id_, patient_id_, reason_;
  Actor opened_by_;
  ScanPurpose purpose_ = ScanPurpose::kFraction;
  bool opening_ = false, wiping_ = false;
  std::optional<Actor> check_;
  std::optional<std::chrono::steady_clock::time_point> confirmed_;
  std::function<Message()> blocking_reason_;
  EventLoop::Source timer_;
};

}  // namespace plumb
