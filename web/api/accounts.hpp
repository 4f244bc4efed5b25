// Set-up, login and accounts: everything that handles passwords.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "web/api/displays.hpp"
#include "web/api/json.hpp"
#include "web/api/routes.hpp"
#include "web/http/gate.hpp"
#include "web/http/server_options.hpp"
#include "web/security/device_cookies.hpp"
#include "web/security/login_limiter.hpp"
#include "web/security/password_worker.hpp"
#include "web/security/sessions.hpp"
#include "web/security/tls_identity.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

/// Used on the loop thread.
class Accounts : public SessionLookup {
 public:
  /// @param options  With a clock; outlives the accounts.
  /// @param replace_certificate  Stores and serves another certificate; throws DataError or
  /// IoError, after which the previous one stays. Empty: it cannot be replaced.
  Accounts(const Services& services, const HttpServerOptions& options,
           std::function<void(const TlsIdentity&)> replace_certificate);

  void AddRoutes(Routes& routes);

  /// The session of a request, by its cookie. @param touch  Counts as a use.
  [[nodiscard]] std::shared_ptr<Session> SessionOf(const Request& request, bool touch) override;
  [[nodiscard]] bool needs_setup() const override { return !setup_code_.empty(); }
  [[nodiscard]] const std::string& accounts_fault() const override { return accounts_fault_; }
  [[nodiscard]] std::string tls_fingerprint() const override {
    return certificate_ ? certificate_->fingerprint : std::string();
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
  [[nodiscard]] Response DescribeSession(const Request& request);
  /// The login before this one, and failed attempts since.
  void ShowLastLogin(const Request& request, const Respond& respond);
  void ChangeOwnPassword(const Request& request, const Respond& respond);
  /// An act that the user has signed with their own password.
  using SignedAct = std::function<void(const Actor&, Done)>;
  /// Adds a route for such an act.
  /// @param parse  Reads the fields of the body besides the password, before the password is read.
  void AddSigned(Routes& routes, const char* method, const char* pattern, Permission permission,
                 std::function<SignedAct(const Request&, Fields&)> parse);
  void AddSignedActs(Routes& routes);
  /// The certificate of the page.
  [[nodiscard]] Response DescribeCertificate() const;
  /// Replaces it by an uploaded one or a new self-signed one; requires the user's own password.
  void ReplaceCertificate(const Request& request, const Respond& respond);
  void MakeNewCertificate(const Request& request, const Respond& respond);
  void ServeCertificate(const Actor& actor, const TlsIdentity& identity, bool is_self_made,
                        const Respond& respond);
  void AddUser(const Request& request, const Respond& respond);
  void ChangeUser(const Request& request, const Respond& respond);
  /// Opens a session and notifies the page.
  [[nodiscard]] Response Welcome(const User& user, bool form);
  /// Sets the cookie by which this browser is recognised from now on.
  void SetDeviceCookie(Response& response, const std::string& user,
                       const std::string& stored) const;
  /// Calls `then` with the hash, or answers why there is none.
  void HashThen(std::string password, const Respond& respond,
                std::function<void(const std::string&)> then);
  /// The same completion, which does nothing once this object is destroyed.
  [[nodiscard]] Done WhileAlive(Done done) const;
  /// The time in the settings; nothing where they cannot be read.
  [[nodiscard]] std::optional<int> IdleLogout_min() const;
  [[nodiscard]] std::string cookie_name() const {
    return certificate_ ? "__Host-plumb_session" : "plumb_session";
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
  const HttpServerOptions& options_;
  std::function<void(const TlsIdentity&)> replace_certificate_;
  std::optional<TlsIdentity> certificate_;  ///< The one that is served now.
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

}  // namespace plumb::web
