// The certificate of the page: showing it, replacing it, creating a new self-signed one.
#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/api/json.hpp"
#include "web/security/certificate_care.hpp"
#include "web/security/password_rules.hpp"

namespace plumb::web {
namespace {

constexpr std::size_t kMaxChainBytes = 32 << 10, kMaxKeyBytes = 16 << 10;

Response NotReplaceable() {
  return ErrorResponse(409,
                       "the certificate cannot be replaced here: the page is served without TLS, "
                       "or the configuration names the certificate (web.tls_certificate)");
}

}  // namespace

Response Accounts::DescribeCertificate() const {
  Json json = {{"fingerprint", tls_fingerprint()},
               {"replaceable", static_cast<bool>(replace_certificate_)}};
  if (certificate_) {
    const CertificateFacts facts = FactsOfCertificate(certificate_->certificate_pem);
    json["subject"] = facts.subject;
    json["valid_until"] = TimeText(facts.valid_until);
  }
  return JsonResponse(json);
}

void Accounts::ReplaceCertificate(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string chain = fields.Text("certificate", 1, kMaxChainBytes, /*allow_lines=*/true);
  const std::string key = fields.Text("key", 1, kMaxKeyBytes, /*allow_lines=*/true);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  if (!replace_certificate_) return respond(NotReplaceable());
  const TlsIdentity identity = UsableTlsIdentity(chain, key, WallClock::now());
  VerifyOwn(request, std::move(password), "the password is wrong", respond,
            [this, identity, actor = request.actor(), respond](const User&) {
              ServeCertificate(actor, identity, /*is_self_made=*/false, respond);
            });
}

void Accounts::MakeNewCertificate(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  if (!replace_certificate_) return respond(NotReplaceable());
  VerifyOwn(request, std::move(password), "the password is wrong", respond,
            [this, actor = request.actor(), respond](const User&) {
              try {
                const TlsIdentity identity = MakeTlsIdentity(options_.host_names);
                ServeCertificate(actor, identity, /*is_self_made=*/true, respond);
              } catch (const std::runtime_error& error) {
                respond(ErrorResponse(500, error.what()));
              }
            });
}

void Accounts::ServeCertificate(const Actor& actor, const TlsIdentity& identity, bool is_self_made,
                                const Respond& respond) {
  const std::string before = tls_fingerprint();
  try {
    replace_certificate_(identity);
  } catch (const std::runtime_error& error) {
    return respond(
        ErrorResponse(500, fmt::format("the certificate was not replaced: {}", error.what())));
  }
  certificate_ = identity;
  audit_.Log(actor, is_self_made ? "certificate.new" : "certificate.replace", "",
             fmt::format("{} -> {}", before, identity.fingerprint));
  respond(JsonResponse({{"fingerprint", identity.fingerprint}}));
}

}  // namespace plumb::web
