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

void Accounts::DescribeCertificate(const Request&, const Respond& respond) {
  Json json = {{"fingerprint", tls_fingerprint()},
               {"replaceable", static_cast<bool>(options_.replace_certificate)}};
  if (options_.certificate) {
    const CertificateFacts facts = FactsOfCertificate(options_.certificate->certificate_pem);
    json["subject"] = facts.subject;
    json["valid_until"] = TimeText(facts.valid_until);
  }
  Response response;
  response.body = Dump(json);
  respond(std::move(response));
}

void Accounts::ReplaceCertificate(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string chain = fields.Text("certificate", 1, kMaxChainBytes, /*allow_lines=*/true);
  const std::string key = fields.Text("key", 1, kMaxKeyBytes, /*allow_lines=*/true);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  if (!options_.replace_certificate) return respond(NotReplaceable());
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
  if (!options_.replace_certificate) return respond(NotReplaceable());
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
    options_.replace_certificate(identity);
  } catch (const std::runtime_error& error) {
    return respond(
        ErrorResponse(500, fmt::format("the certificate was not replaced: {}", error.what())));
  }
  options_.certificate = identity;
  audit_.Log(actor, is_self_made ? "certificate.new" : "certificate.replace", "",
             fmt::format("{} -> {}", before, identity.fingerprint));
  Response response;
  response.body = Dump({{"fingerprint", identity.fingerprint}});
  respond(std::move(response));
}

}  // namespace plumb::web
