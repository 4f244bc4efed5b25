// Actions that a logged-in user signs with the own password.
#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/api/json.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/security/password_rules.hpp"

namespace plumb::web {

void Accounts::AcceptOutside(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string reason = fields.Text("reason", kMinReason, kMaxReason);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond,
         [this, reason, scan = request.arguments.at(0)](const Actor& actor, Done done) {
           scans_.AcceptScan(actor, scan, reason, std::move(done));
         });
}

void Accounts::ApproveReference(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const int revision = fields.Integer("revision", 1, kMaxRevision);
  const std::string digest = fields.Text("digest", 1, 64);  // of what the person was shown
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond,
         [this, revision, digest, id = request.arguments.at(0)](const Actor& actor, Done done) {
           references_.ApproveReference(actor, id, revision, digest, std::move(done));
         });
}

void Accounts::WipePatient(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond,
         [this, id = request.arguments.at(0)](const Actor& actor, Done done) {
           patients_.WipePatient(actor, id, std::move(done));
         });
}

void Accounts::Signed(const Request& request, std::string password, const Respond& respond,
                      std::function<void(const Actor&, Done)> act) {
  VerifyOwn(request, std::move(password), "the password is wrong", respond,
            [this, act = std::move(act), actor = request.actor(), respond](const User&) {
              act(actor,
                  WhileAlive([respond](const Change& change) { respond(ChangeResponse(change)); }));
            });
}

void Accounts::RestartSystem(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond,
         [this](const Actor& actor, Done done) { updates_.RestartSystem(actor, std::move(done)); });
}

void Accounts::ResetToFactory(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string kind = fields.Text("kind", 1, 32);
  if (kind != "keep_records" && kind != "wipe")
    throw DataError("kind: expected keep_records or wipe");
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond,
         [this, reset = kind == "wipe" ? FactoryReset::kWipe : FactoryReset::kKeepRecords](
             const Actor& actor, Done done) {
           updates_.ResetToFactory(actor, reset, std::move(done));
         });
}

void Accounts::SignRoomCalibration(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string digest = fields.Text("digest", 64, 64);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond, [this, digest](const Actor& actor, Done done) {
    room_.SignRoomCalibration(actor, digest, std::move(done));
  });
}

void Accounts::ResetSensorProfile(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string serial = fields.Text("serial", 1, 256);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond, [this, serial](const Actor& actor, Done done) {
    profiles_.ResetSensorProfile(actor, serial, std::move(done));
  });
}

void Accounts::RollBackSensorProfile(const Request& request, const Respond& respond) {
  Fields fields(request.body);
  const std::string serial = fields.Text("serial", 1, 256);
  const int version = fields.Integer("version", 1, 999'999'999);
  std::string password = fields.Text("password", 1, kMaxPassword);
  fields.Finish();
  Signed(request, std::move(password), respond,
         [this, serial, version](const Actor& actor, Done done) {
           profiles_.RollBackSensorProfile(actor, serial, version, std::move(done));
         });
}

}  // namespace plumb::web
