// SPDX-License-Identifier: Apache-2.0
// Actions that a logged-in user signs with the own password.
#include <utility>

#include "algo/base/errors.hpp"
#include "web/api/accounts.hpp"
#include "web/exchange/json.hpp"
#include "web/model/account.hpp"
#include "web/model/limits.hpp"
#include "web/security/password_rules.hpp"
#include "words/web.hpp"

namespace plumb::web {

void Accounts::AddSigned(Routes& routes, const char* method, const char* pattern,
                         Permission permission,
                         std::function<SignedAct(const Request&, Fields&)> parse) {
  routes.Add(method, pattern, permission, BodyKind::kJson,
             [this, parse = std::move(parse)](const Request& request, const Respond& respond) {
               Fields fields(request.body);
               SignedAct act = parse(request, fields);
               OwnProof proof = ReadProof(fields, "password");
               fields.Finish();
               VerifyOwn(request, std::move(proof), say::web::WrongPassword(), respond,
                         [this, act = std::move(act), actor = request.actor(),
                          respond](const User&) { act(actor, WhileAlive(Answer(respond))); });
             });
}

void Accounts::AddSignedActs(Routes& routes) {
  // Accepts a result that is not in tolerance: with a reason.
  AddSigned(routes, "POST", "/api/v1/scans/{id}/accept-outside", Permission::kAccept,
            [this](const Request& request, Fields& fields) -> SignedAct {
              return [this, scan = request.arguments.at(0),
                      reason = fields.Text("reason", kMinReason, kMaxReason)](const Actor& actor,
                                                                              Done done) {
                scans_.AcceptScan(actor, scan, reason, std::move(done));
              };
            });
  // Accepts the position that live monitoring shows, with a reason where it is out.
  AddSigned(routes, "POST", "/api/v1/monitor/accept", Permission::kAccept,
            [this](const Request&, Fields& fields) -> SignedAct {
              const std::string reason = fields.Has("reason")
                                             ? fields.Text("reason", kMinReason, kMaxReason)
                                             : std::string();
              return [this, reason](const Actor& actor, Done done) {
                monitoring_.AcceptLive(actor, reason, std::move(done));
              };
            });
  AddSigned(routes, "POST", "/api/v1/treatment/fraction", Permission::kAccept,
            [this](const Request&, Fields& fields) -> SignedAct {
              const std::string session = fields.Text("session_id", 1, 64);
              const int fraction = fields.Integer("fraction", 1, kMaxFraction);
              return
                  [this, session, fraction, reason = fields.Text("reason", kMinReason, kMaxReason)](
                      const Actor& actor, Done done) {
                    patients_.CorrectFraction(actor, session, fraction, reason, std::move(done));
                  };
            });
  // Approves the plan that the person was shown, identified by its revision and digest.
  AddSigned(routes, "POST", "/api/v1/references/{id}/approve", Permission::kApprove,
            [this](const Request& request, Fields& fields) -> SignedAct {
              const int revision = fields.Integer("revision", 1, kMaxRevision);
              Considered considered;
              if (fields.Has("reason"))
                considered.reason = fields.Text("reason", kMinReason, kMaxReason);
              if (fields.Has("posture_confirmed"))
                considered.posture = fields.Flag("posture_confirmed");
              if (fields.Has("images_confirmed"))
                considered.images = fields.Flag("images_confirmed");
              return [this, id = request.arguments.at(0), revision, considered,
                      digest = fields.Text("digest", 1, 64)](const Actor& actor, Done done) {
                references_.ApproveReference(actor, id, revision, digest, considered,
                                             std::move(done));
              };
            });
  AddSigned(routes, "DELETE", "/api/v1/patients/{id}", Permission::kWipe,
            [this](const Request& request, Fields&) -> SignedAct {
              return [this, id = request.arguments.at(0)](const Actor& actor, Done done) {
                patients_.WipePatient(actor, id, std::move(done));
              };
            });
  AddSignedRoomActs(routes);
  AddSignedUnitActs(routes);
}

void Accounts::AddSignedRoomActs(Routes& routes) {
  // Signs the room's calibration that the person was shown, identified by its digest.
  AddSigned(routes, "POST", "/api/v1/room-calibration/sign", Permission::kCalibrate,
            [this](const Request&, Fields& fields) -> SignedAct {
              return [this, digest = fields.Text("digest", 64, 64)](const Actor& actor, Done done) {
                room_.SignRoomCalibration(actor, digest, std::move(done));
              };
            });
  // The couch as the person has read it, with the version that this replaces.
  AddSigned(routes, "POST", "/api/v1/couch", Permission::kCalibrate,
            [this](const Request&, Fields& fields) -> SignedAct {
              return [this, couch = ReadCouch(fields)](const Actor& actor, Done done) {
                room_.SignCouch(actor, couch, std::move(done));
              };
            });
}

void Accounts::AddSignedUnitActs(Routes& routes) {
  // Makes a daily check the one that later ones are compared with.
  AddSigned(routes, "POST", "/api/v1/checks/{id}/baseline", Permission::kPlan,
            [this](const Request& request, Fields& fields) -> SignedAct {
              return [this, id = request.arguments.at(0),
                      reason = fields.Text("reason", kMinReason, kMaxReason)](const Actor& actor,
                                                                              Done done) {
                checks_.SetCheckBaseline(actor, id, reason, std::move(done));
              };
            });
  AddSigned(routes, "POST", "/api/v1/displays", Permission::kUsers,
            [this](const Request&, Fields& fields) -> SignedAct {
              const std::string code = fields.Text("code", 1, 16);
              return [this, code, name = fields.Text("name", 1, kMaxName)](const Actor& actor,
                                                                           Done done) {
                displays_.Approve(actor, code, name, done);
              };
            });
  AddSigned(routes, "DELETE", "/api/v1/displays/{id}", Permission::kUsers,
            [this](const Request& request, Fields&) -> SignedAct {
              return [this, id = request.arguments.at(0)](const Actor& actor, Done done) {
                displays_.Remove(actor, id, done);
              };
            });
  AddSigned(routes, "POST", "/api/v1/sensor-profile/reset", Permission::kSettings,
            [this](const Request&, Fields& fields) -> SignedAct {
              return [this, serial = fields.Text("serial", 1, 256)](const Actor& actor, Done done) {
                profiles_.ResetSensorProfile(actor, serial, std::move(done));
              };
            });
  AddSigned(routes, "POST", "/api/v1/sensor-profile/roll-back", Permission::kSettings,
            [this](const Request&, Fields& fields) -> SignedAct {
              const std::string serial = fields.Text("serial", 1, 256);
              return [this, serial, version = fields.Integer("version", 1, 999'999'999)](
                         const Actor& actor, Done done) {
                profiles_.RollBackSensorProfile(actor, serial, version, std::move(done));
              };
            });
  AddSigned(routes, "POST", "/api/v1/update/restart", Permission::kUpdate,
            [this](const Request&, Fields&) -> SignedAct {
              return [this](const Actor& actor, Done done) {
                updates_.RestartSystem(actor, std::move(done));
              };
            });
  AddSigned(routes, "POST", "/api/v1/system/factory-reset", Permission::kUpdate,
            [this](const Request&, Fields& fields) -> SignedAct {
              const std::string kind = fields.Text("kind", 1, 32);
              if (kind != "keep_records" && kind != "wipe") throw DataError(say::web::FieldReset());
              return
                  [this, reset = kind == "wipe" ? FactoryReset::kWipe : FactoryReset::kKeepRecords](
                      const Actor& actor, Done done) {
                    updates_.ResetToFactory(actor, reset, std::move(done));
                  };
            });
}

}  // namespace plumb::web
