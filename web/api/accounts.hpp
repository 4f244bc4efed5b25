// Set-up, login and accounts: everything that handles passwords.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "web/api/displays.hpp"
#include "web/http/gate.hpp"
#include "web/http/router.hpp"
#include "web/security/device_cookies.hpp"
#include "web/security/login_limiter.hpp"
#include "web/security/password_worker.hpp"
#include "web/security/sessions.hpp"
#include "web/security/tls_identity.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

struct AccountOptions {
  std::uint64_t password_operations = 3;
  std::uint64_t password_memory_bytes = 64 << 20;
  std::chrono::seconds session_limit{12 * 3600};
  std::string device_key;                  ///< See DeviceCookies.
  std::optional<TlsIdentity> certificate;  ///< Its fingerprint is shown at the first set-up.
  std::function<std::chrono::steady_clock::time_point()> now;
  std::vector<std::string> host_names;  ///< Names for a new certificate.
  /// Stores and serves another certificate; throws DataError or IoError, after which the previous
  /// one stays. Empty: it cannot be replaced.
  std::function<void(const TlsIdentity&)> replace_certificate;
};

/// Used on the loop thread.
class Accounts : public SessionLookup {
 public:
  Accounts(const Services& services, AccountOptions options);

  void AddRoutes(Router& router);

  /// The session of a request, by its cookie. @param touch  Counts as a use.
  [[nodiscard]] std::shared_ptr<Session> SessionOf(const Request& request, bool touch) override;
  [[nodiscard]] bool needs_setup() const override { return !setup_code_.empty(); }
  [[nodiscard]] const std::string& accounts_fault() const override { return accounts_fault_; }
  [[nodiscard]] std::string tls_fingerprint() const override {
    return options_.certificate ? options_.certificate->fingerprint : std::string();
  }
  [[nodiscard]] std::optional<std::string> setup_code() const;

  /// Descriptor of the password thread: readable when Dispatch() has something to do.
  [[nodiscard]] int fd() const { return worker_.fd(); }
  void Dispatch() { worker_.Dispatch(); }
  /// Ends idle sessions; follows the idle time of the settings; looks again for accounts that could
  /// not be read.
  void Expire();

 private:
  void LookForAccounts();
  void SetUp(const Request& request, const Respond& respond);
  void LogIn(const Request& request, const std::string& name, std::string password, bool form,
             const Respond& respond);
  void FinishLogIn(const Actor& actor, const std::string& stored, bool matches, bool form,
                   const std::vector<std::string>& counters, const Respond& respond);
  /// The counters for guesses at this name: only that of its browser if the person has logged in
  /// from it before, otherwise those of address and name.
  [[nodiscard]] std::vector<std::string> CountersOf(const Request& request, const std::string& name,
                                                    const std::string& stored) const;
  /// Time until the next guess, or nothing; the guess is then counted.
  [[nodiscard]] std::optional<Response> CountGuess(const std::vector<std::string>& counters);
  /// Checks the password of a logged-in user; calls `then` if it is correct.
  void VerifyOwn(const Request& request, std::string password, const char* wrong,
                 const Respond& respond, std::function<void(const User&)> then);
  void LogOut(const Request& request, const Respond& respond);
  void SetPreferences(const Request& request, const Respond& respond);
  void DescribeSession(const Request& request, const Respond& respond);
  /// The login before this one, and failed attempts since.
  void ShowLastLogin(const Request& request, const Respond& respond);
  void ChangeOwnPassword(const Request& request, const Respond& respond);
  /// Accepts a result that is not in tolerance: with a reason and the user's own password.
  void AcceptOutside(const Request& request, const Respond& respond);
  /// Approves the plan that was read, identified by its revision and digest.
  void ApproveReference(const Request& request, const Respond& respond);
  void WipePatient(const Request& request, const Respond& respond);
  /// Calls `act` if the password is the user's own, and answers with the outcome.
  void Signed(const Request& request, std::string password, const Respond& respond,
              std::function<void(const Actor&, Done)> act);
  /// Signs the room's calibration that was read, identified by its digest.
  void SignRoomCalibration(const Request& request, const Respond& respond);
  void ResetSensorProfile(const Request& request, const Respond& respond);
  void RollBackSensorProfile(const Request& request, const Respond& respond);
  /// Restarts the machine; requires the user's own password.
  void RestartSystem(const Request& request, const Respond& respond);
  /// Resets the appliance to the state of delivery; requires the user's own password.
  void ResetToFactory(const Request& request, const Respond& respond);
  /// The certificate of the page.
  void DescribeCertificate(const Request& request, const Respond& respond);
  /// Replaces it by an uploaded one or a new self-signed one; requires the user's own password.
  void ReplaceCertificate(const Request& request, const Respond& respond);
  void MakeNewCertificate(const Request& request, const Respond& respond);
  void ServeCertificate(const Actor& actor, const TlsIdentity& identity, bool is_self_made,
                        const Respond& respond);
  void AddUser(const Request& request, const Respond& respond);
  void ChangeUser(const Request& request, const Respond& respond);
  /// Opens a session and notifies the page.
  [[nodiscard]] Response Welcome(const User& user, bool form);
  /// The cookie by which this browser is recognised from now on.
  [[nodiscard]] std::string DeviceCookie(const std::string& user, const std::string& stored) const;
  /// Calls `then` with the hash, or answers why there is none.
  void HashThen(std::string password, const Respond& respond,
                std::function<void(const std::string&)> then);
  /// The same completion, which does nothing once this object is destroyed.
  [[nodiscard]] Done WhileAlive(Done done) const;
  /// The time in the settings; nothing where they cannot be read.
  [[nodiscard]] std::optional<int> IdleLogout_min() const;
  [[nodiscard]] std::string Cookie(const std::string& token, bool end) const;
  [[nodiscard]] std::string cookie_name() const {
    return options_.certificate ? "__Host-plumb_session" : "plumb_session";
  }

  AccountService& users_;
  AuditLog& audit_;
  SettingsService& settings_;
  PatientService& patients_;
  ReferenceService& references_;
  ScanService& scans_;
  RoomCalibrationService& room_;
  SensorProfileService& profiles_;
  UpdateService& updates_;
  BackgroundWork& background_;
  AccountOptions options_;
  Sessions sessions_;
  Displays displays_;
  DeviceCookies devices_;
  LoginLimiter limiter_;
  std::string accounts_fault_;  ///< Why no account can be seen; empty: they can.
  std::string setup_code_;      ///< Empty once there is an account.
  bool setting_up_ = false;
  int idle_logout_min_ = Settings{}.idle_logout_min;  ///< As last read.
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  PasswordWorker worker_;
};

/// The answer to a change as HTTP: 200, 201 with an id, or the error.
[[nodiscard]] Response ChangeResponse(const Change& change);

}  // namespace plumb::web
