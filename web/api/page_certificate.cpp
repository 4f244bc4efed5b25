// SPDX-License-Identifier: Apache-2.0
// The certificate of the page: showing it, replacing it, creating a new self-signed one.
#include <cstdio>
#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/exchange/json.hpp"
#include "web/security/certificate_care.hpp"
#include "web/security/password_rules.hpp"
#include "words/audit.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxChainBytes = 32 << 10, kMaxKeyBytes = 16 << 10;

/// A certificate that a person set is taken back unless a browser has connected with it by then.
constexpr std::chrono::seconds kTrial{120};
/// How often, and for how long the clock must have run without a step for its date to count.
constexpr std::chrono::minutes kCareEvery{10}, kClockHeld{60}, kAddressHeld{60};
constexpr std::chrono::minutes kClockStep{1};

/// The appliance itself, as the store names it.
const Actor kSelf{.user = "plumbd", .address = ""};

Response NotReplaceable() { return ErrorResponse(409, say::web::NotReplaceable()); }

}  // namespace

Response Accounts::DescribeCertificate() const {
  Json json = {{"fingerprint", tls_fingerprint()},
               {"replaceable", static_cast<bool>(serve_certificate_)},
               {"on_trial", trial_.has_value()}};
  if (certificate_) {
    const CertificateFacts facts = FactsOfCertificate(certificate_->certificate_pem);
    json["subject"] = facts.subject;
    json["valid_until"] = TimeText(facts.valid_until);
  }
  const auto authority = OwnAuthority();
  json["authority"] = authority ? Json(authority->fingerprint) : Json(nullptr);
  return JsonResponse(json);
}

std::optional<AuthorityCertificate> Accounts::OwnAuthority() const {
  return certificate_ ? OwnAuthorityOf(certificate_->certificate_pem) : std::nullopt;
}

/// For tablets that do not trust this unit yet, so without a log-in; it is no secret.
Response Accounts::SendAuthority() const {
  const auto authority = OwnAuthority();
  if (!authority) return ErrorResponse(404, say::web::NoAuthority());
  return BodyResponse("application/x-x509-ca-cert", authority->pem);
}

void Accounts::ReplaceCertificate(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string chain = fields.Text("certificate", 1, kMaxChainBytes, /*allow_lines=*/true);
  const std::string key = fields.Text("key", 1, kMaxKeyBytes, /*allow_lines=*/true);
  OwnProof proof = ReadProof(fields, "password");
  fields.Finish();
  if (!serve_certificate_) return respond(NotReplaceable());
  const TlsIdentity identity = UsableTlsIdentity(chain, key, WallClock::now());
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [this, identity, actor = request.actor(), respond](const User&) {
              const TlsIdentity before = trial_ ? trial_->before : *certificate_;
              try {
                // Shows now, not at the end of the trial, whether a certificate can be stored.
                options_.keep_certificate(before);
                ServeCertificate(actor, identity, "certificate.replace");
              } catch (const std::runtime_error& error) {
                return respond(ErrorResponse(500, say::web::NotReplaced(MessageOf(error))));
              }
              trial_ = {before, options_.now()};
              Response response = JsonResponse(
                  {{"fingerprint", identity.fingerprint}, {"trial_s", kTrial.count()}});
              response.headers.emplace_back("Connection", "close");
              respond(std::move(response));
            });
}

void Accounts::MakeNewCertificate(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  OwnProof proof = ReadProof(fields, "password");
  fields.Finish();
  if (!serve_certificate_) return respond(NotReplaceable());
  VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
            [this, actor = request.actor(), respond](const User&) {
              try {
                const TlsIdentity identity = options_.make_certificate(options_.wall_now());
                options_.keep_certificate(identity);
                trial_.reset();
                ServeCertificate(actor, identity, "certificate.new");
                respond(JsonResponse({{"fingerprint", identity.fingerprint}}));
              } catch (const std::runtime_error& error) {
                respond(ErrorResponse(500, say::web::NotReplaced(MessageOf(error))));
              }
            });
}

void Accounts::ServeCertificate(const Actor& actor, const TlsIdentity& identity,
                                const char* replaced_by) {
  const std::string before = tls_fingerprint();
  serve_certificate_(identity);
  certificate_ = identity;
  certificate_end_ = FactsOfCertificate(identity.certificate_pem).valid_until;
  if (options_.on_certificate) options_.on_certificate(identity);
  audit_.Log(actor, replaced_by, "", say::audit::Certificate(before, identity.fingerprint));
}

void Accounts::KeepTriedCertificate() {
  try {
    options_.keep_certificate(*certificate_);
    trial_.reset();
  } catch (const std::runtime_error&) {
    EndTrial("certificate.not_kept");
  }
}

void Accounts::EndTrial(const char* log_as) {
  const TlsIdentity before = trial_->before;
  trial_.reset();
  ServeCertificate(kSelf, before, log_as);
}

std::optional<std::chrono::seconds> Accounts::CertificateLeft() const {
  if (!certificate_) return std::nullopt;
  return std::chrono::seconds(certificate_end_ -
                              std::chrono::system_clock::to_time_t(options_.wall_now()));
}

std::vector<std::string> Accounts::SteadyAddresses(std::chrono::steady_clock::time_point now) {
  // A self-signed certificate would be asked about again on every screen.
  if (!OwnAuthorityOf(certificate_->certificate_pem)) return {};
  std::vector<std::string> found = options_.own_addresses();
  // Those of IPv6 may change every day, for privacy; they are renewed with the others.
  std::erase_if(found, [](const std::string& one) { return one.find(':') != std::string::npos; });
  std::map<std::string, std::chrono::steady_clock::time_point> since;
  for (const std::string& one : found) {
    const auto before = addresses_since_.find(one);
    since[one] = before == addresses_since_.end() ? now : before->second;
  }
  addresses_since_ = std::move(since);
  std::erase_if(
      found, [&](const std::string& one) { return now - addresses_since_.at(one) < kAddressHeld; });
  return found;
}

void Accounts::CareForCertificate() {
  const auto now = options_.now();
  if (!serve_certificate_) return;
  const auto ahead = options_.wall_now().time_since_epoch() - now.time_since_epoch();
  if (std::chrono::abs(ahead - clock_ahead_) > kClockStep) clock_steady_since_ = now;
  clock_ahead_ = ahead;
  if (trial_ && now - trial_->begun >= kTrial) EndTrial("certificate.revert");
  if (trial_ || now < next_certificate_care_) return;
  next_certificate_care_ = now + kCareEvery;
  try {
    std::vector<std::string> names = OwnNames();
    for (const std::vector<std::string>& more : {options_.host_names, SteadyAddresses(now)})
      names.insert(names.end(), more.begin(), more.end());
    // A clock that has just started or stepped may still be corrected.
    const bool is_trusted = now - clock_steady_since_ >= kClockHeld && options_.is_clock_trusted();
    const auto wall = options_.wall_now();
    if (!IsDueForRenewal(certificate_->certificate_pem,
                         is_trusted ? std::optional(wall) : std::nullopt, names))
      return;
    const TlsIdentity identity = options_.make_certificate(wall);
    options_.keep_certificate(identity);
    ServeCertificate(kSelf, identity, "certificate.renew");
  } catch (const std::runtime_error& error) {
    // The previous one stays, with a warning before it expires.
    std::fprintf(stderr, "web: the page's certificate was not renewed: %s\n", error.what());
  }
}

}  // namespace plumb::web
