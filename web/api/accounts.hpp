// SPDX-License-Identifier: Apache-2.0
// Set-up, login and accounts: everything that handles passwords.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "web/api/displays.hpp"
#include "web/exchange/json.hpp"
#include "web/exchange/routes.hpp"
#include "web/http/gate.hpp"
#include "web/http/server_options.hpp"
#include "web/security/device_cookies.hpp"
#include "web/security/known_places.hpp"
#include "web/security/login_limiter.hpp"
#include "web/security/password_worker.hpp"
#include "web/security/quick_logins.hpp"
#include "web/security/sessions.hpp"
#include "web/security/tls_identity.hpp"
#include "web/service/services.hpp"

namespace plumb::web {

/// What a logged-in user gives to sign an act.
struct OwnProof {
  std::string password;
  std::string second_factor;  ///< A code of the authenticator or a recovery code; empty: none.
};

/// What somebody types to log in.
struct LogInForm {
  std::string name;
  std::string password;
  std::string second_factor;  ///< As in OwnProof.
  std::string presence;       ///< The code that a screen in the room shows; empty: none.
  bool is_form = false;       ///< Of the page without scripts.
};

/// The answer while too many passwords wait to be hashed.
[[nodiscard]] Response BusyWithPasswords();

/// Used on the loop thread.
class Accounts : public SessionLookup {
 public:
  /// @param options  With a clock; outlives the accounts.
  /// @param serve_certificate  Serves another certificate; throws DataError, after which the
  /// previous one stays. Empty: it cannot be replaced.
  Accounts(const Services& services, const HttpServerOptions& options,
           std::function<void(const TlsIdentity&)> serve_certificate);

  void AddRoutes(Routes& routes);

  /// The session of a request, by its cookie. @param touch  Counts as a use.
  [[nodiscard]] std::shared_ptr<Session> SessionOf(const Request& request, bool touch) override;
  [[nodiscard]] bool needs_setup() const override { return !setup_code_.empty(); }
  [[nodiscard]] const Message& accounts_fault() const override { return accounts_fault_; }
  [[nodiscard]] std::string tls_fingerprint() const override {
    return certificate_ ? certificate_->fingerprint : std::string();
  }
  [[nodiscard]] std::optional<std::string> setup_code() const;
  /// The code by which people prove that they see a screen in the room or the console: their right
  /// password is then never refused because others are guessing. Changes every ten minutes; the
  /// previous one is accepted for ten more.
  [[nodiscard]] std::string presence_code();

  /// Descriptor of the password thread: readable when Dispatch() has something to do.
  [[nodiscard]] int fd() const { return worker_.fd(); }
  void Dispatch() { worker_.Dispatch(); }
  /// Takes back a certificate that a person set and no browser has come back with in time, and
  /// renews one that this machine made for itself. Called from time to time.
  void CareForCertificate();
  /// Time until the page's certificate ends; nothing without one.
  [[nodiscard]] std::optional<std::chrono::seconds> CertificateLeft() const override;
  /// Ends idle sessions; follows the idle time of the settings; looks again for accounts that could
  /// not be read.
  void Expire();

 private:
  void LookForAccounts();
  void SetUp(const Request& request, const Respond& respond);
  void LogIn(const Request& request, LogInForm form, const Respond& respond);
  /// Of a person whom the clinic's directory knows: the account and its role follow from it.
  void FinishDirectoryLogIn(const Actor& actor, const DirectoryAnswer& answer,
                            const LogInForm& form, const std::vector<std::string>& counters,
                            const Respond& respond);
  void FinishLogIn(const Actor& actor, const std::string& stored, const LogInForm& form,
                   const std::vector<std::string>& counters, const Respond& respond);
  /// With the name only if there is such an account.
  void LogFailedLogIn(const Actor& actor, const Message& why);
  struct Counters {
    std::vector<std::string> names;
    bool is_known = false;  ///< Guesses of strangers neither count for it nor delay it.
  };
  /// The counters for guesses at this name: only one of its own if the person is in the room, or
  /// has logged in from this browser or address before, otherwise those of address and name.
  [[nodiscard]] Counters CountersOf(const Request& request, const LogInForm& form,
                                    const std::string& stored);
  /// Whether the request comes from a paired screen, or has the code that such a screen shows.
  [[nodiscard]] bool IsInTheRoom(const Request& request, const std::string& presence);
  void NoteGuesses(bool are_running);
  [[nodiscard]] Response DescribePresence(const Request& request);
  /// Time until the next guess, or nothing; the guess is then counted.
  [[nodiscard]] std::optional<Response> CountGuess(const std::vector<std::string>& counters);
  void TakeGuessBack(const std::vector<std::string>& counters);
  /// Ends what is open of a person: sessions, and log-ins by PIN or badge.
  void EndAllOf(const std::string& name);
  /// Takes the proof from the body. @param password  Name of the field with the password.
  [[nodiscard]] static OwnProof ReadProof(Fields& fields, const char* password);
  /// Calls `then` if the person has no second factor, or if `given` is right; it is then used up.
  /// @param fail  Answers otherwise.
  void PassSecondFactor(const Actor& actor, const User& user, const std::string& given,
                        const Respond& fail, const std::function<void()>& then);
  void AddQuickLogInRoutes(Routes& routes);
  /// The browser, if this person has logged in there with the present password.
  [[nodiscard]] std::optional<std::string> DeviceOf(const Request& request, const User& user) const;
  /// Who can log in quickly in this browser.
  [[nodiscard]] Response ListQuickPeople(const Request& request);
  /// @param before  Session that ends by it; null: none.
  void LogInQuickly(const Request& request, const std::shared_ptr<Session>& before,
                    const Respond& respond);
  [[nodiscard]] Response WelcomeQuickly(const User& user, const Actor& actor);
  void SetPin(const Request& request, const Respond& respond);
  void AddSecondFactorRoutes(Routes& routes);
  /// Answers with a secret for an authenticator; FinishSecondFactor() checks its first code.
  void OfferSecondFactor(const Request& request, const Respond& respond);
  void FinishSecondFactor(const Request& request, const Respond& respond);
  void RemoveSecondFactor(const Request& request, const Respond& respond);
  void AddSessionRoutes(Routes& routes);
  [[nodiscard]] Response ListSessions(const Request& request);
  void EndSession(const Request& request, const Respond& respond);
  void EndOtherSessions(const Request& request, const Respond& respond);
  /// Calls `done` unless this object is destroyed, and answers if that throws. Answers, too, if the
  /// queue is full or the question failed: the attempt is then not counted.
  void AskDirectoryOf(const std::string& name, std::string password,
                      const std::vector<std::string>& counters, const Respond& respond,
                      std::function<void(const DirectoryAnswer&)> done);
  /// Calls `done`; answers 503 if the password cannot be checked, which is not counted as a guess.
  void CheckPassword(std::string password, std::string hash, bool trusted, const Respond& respond,
                     std::function<void()> take_guess_back, std::function<void(bool matches)> done);
  /// Of a logged-in user; likewise.
  void VerifyPassword(const User& user, std::string password,
                      const std::vector<std::string>& counters, const Respond& respond,
                      std::function<void(bool matches)> done);
  /// Checks the password of a logged-in user, and the second factor of one who has it; calls `then`
  /// if they are correct.
  void VerifyOwn(const Request& request, OwnProof proof, const Message& wrong,
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
  void AddCertificateRoutes(Routes& routes);
  void AddSignedRoomActs(Routes& routes);
  void AddSignedUnitActs(Routes& routes);
  /// The certificate of the page.
  [[nodiscard]] Response DescribeCertificate() const;
  /// Of the unit's own authority, if that has signed it.
  [[nodiscard]] std::optional<AuthorityCertificate> OwnAuthority() const;
  [[nodiscard]] Response SendAuthority() const;
  /// Replaces it by an uploaded one or a new self-signed one; requires the user's own password.
  void ReplaceCertificate(const Request& request, const Respond& respond);
  void MakeNewCertificate(const Request& request, const Respond& respond);
  /// IPv4 addresses that this machine has had for an hour: its certificate must name them, if its
  /// own authority has signed it.
  [[nodiscard]] std::vector<std::string> SteadyAddresses(std::chrono::steady_clock::time_point now);
  /// Serves an identity from now on. @param replaced_by  Action in the log.
  void ServeCertificate(const Actor& actor, const TlsIdentity& identity, const char* replaced_by);
  /// A browser has come back with the certificate on trial: it is kept.
  void KeepTriedCertificate();
  /// The certificate before the one on trial is served again.
  void EndTrial(const char* log_as);
  void AddUser(const Request& request, const Respond& respond);
  void ChangeUser(const Request& request, const Respond& respond);
  /// Opens a session and notifies the page.
  [[nodiscard]] Response Welcome(const User& user, const std::string& address, bool form);
  /// Sets the cookie by which this browser is recognised from now on, and begins a shift there.
  void SetDeviceCookie(Response& response, const std::string& user, const std::string& stored);
  /// Calls `then` with the hash, or answers why there is none.
  void HashThen(std::string password, const Respond& respond,
                std::function<void(const std::string&)> then);
  /// The same completion, which does nothing once this object is destroyed.
  [[nodiscard]] Done WhileAlive(Done done) const;
  /// The idle time may have changed.
  void FollowSettings();
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
  MonitoringService& monitoring_;
  CheckService& checks_;
  RoomCalibrationService& room_;
  SensorProfileService& profiles_;
  UpdateService& updates_;
  BackgroundWork& background_;
  const HttpServerOptions& options_;
  std::function<void(const TlsIdentity&)> serve_certificate_;
  std::optional<TlsIdentity> certificate_;  ///< The one that is served now.
  std::time_t certificate_end_ = 0;
  /// A certificate that a person set is on trial until a browser has connected with it. Until then
  /// only the previous one is stored, so that a restart ends the trial, too.
  struct CertificateTrial {
    TlsIdentity before;
    std::chrono::steady_clock::time_point begun;
  };
  std::optional<CertificateTrial> trial_;
  std::chrono::steady_clock::time_point next_certificate_care_{}, clock_steady_since_{};
  /// Addresses of this machine at the last look, and since when it has had each.
  std::map<std::string, std::chrono::steady_clock::time_point> addresses_since_;
  std::chrono::system_clock::duration clock_ahead_{};  ///< Of the steady clock, at the last look.
  Sessions sessions_;
  Displays displays_;
  DeviceCookies devices_;
  QuickLogIns quick_;
  LoginLimiter limiter_;
  KnownPlaces places_;
  Message accounts_fault_;  ///< Why no account can be seen; empty: they can.
  std::string setup_code_;  ///< Empty once there is an account.
  bool setting_up_ = false;
  std::string presence_, presence_before_;
  std::chrono::steady_clock::time_point presence_made_{};
  /// When a stranger's guess was last refused; nothing if that was longer than kGuessesShown ago.
  std::optional<std::chrono::steady_clock::time_point> guessed_;
  int idle_logout_min_ = Settings{}.idle_logout_min;  ///< As last read.
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);
  PasswordWorker worker_;
};

}  // namespace plumb::web
