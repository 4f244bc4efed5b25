// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_receive.hpp"

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/assoc.h>
#include <dcmtk/dcmnet/dimse.h>
#include <dcmtk/dcmnet/diutil.h>
#include <dcmtk/dcmtls/tlslayer.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string_view>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "drivers/dicom/dicom_network.hpp"
#include "drivers/dicom/lock_down.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

/// Seconds until the next command of an association.
constexpr int kIdlePatience_s = 30;

constexpr auto kStoredClasses = std::to_array<const char*>(
    {UID_RTStructureSetStorage, UID_RTPlanStorage, UID_CTImageStorage, UID_RawDataStorage});

/// What others wrote, for a line of the journal.
std::string Harmless(std::string_view text) {
  constexpr std::size_t kMost = 64;
  std::string line(text.substr(0, kMost));
  std::ranges::replace_if(
      line, [](char c) { return c < ' ' || c > '~'; }, '?');
  return line;
}

class Receiver {
 public:
  Receiver(int connection, const ReceiveRules& rules) : rules_(rules) {
    dcmExternalSocketHandle.set(connection);
    Require(ASC_initializeNetwork(NET_ACCEPTOR, 0, kAssociatePatience_s, &network_));
    if (rules.tls.empty()) return;
    tls_ = MakeDicomTls(rules.tls, DicomRole::kReceives);
    Require(ASC_setTransportLayer(network_, tls_.get(), 0));
  }
  // The process ends with the association; the kernel closes what is open.
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  void Serve() {
    const OFCondition received =
        ASC_receiveAssociation(network_, &association_, ASC_DEFAULTMAXPDU, nullptr, nullptr,
                               !rules_.tls.empty(), DUL_NOBLOCK, kAssociatePatience_s);
    if (received.bad())
      return rules_.audit(fmt::format("refused: no association ({})", Harmless(received.text())));
    if (!Accept()) return;
    while (ServeCommand()) {
    }
  }

 private:
  static void Require(const OFCondition& condition) {
    if (condition.bad()) throw IoError(say::dicom::NotWritten(condition.text()));
  }

  void Reject(T_ASC_RejectParametersReason reason, const std::string& why) {
    const T_ASC_RejectParameters rejection{ASC_RESULT_REJECTEDPERMANENT, ASC_SOURCE_SERVICEUSER,
                                           reason};
    (void)ASC_rejectAssociation(association_, &rejection);
    (void)ASC_dropSCPAssociation(association_, kAssociatePatience_s);
    rules_.audit("refused: " + why);
  }

  bool Accept() {
    DIC_AE calling{}, called{};
    std::array<char, 128> context{};
    if (ASC_getAPTitles(association_->params, calling, sizeof calling, called, sizeof called,
                        nullptr, 0)
            .bad() ||
        ASC_getApplicationContextName(association_->params, context.data(), context.size()).bad() ||
        std::string_view(context.data()) != UID_StandardApplicationContext) {
      Reject(ASC_REASON_SU_APPCONTEXTNAMENOTSUPPORTED, "another application context");
      return false;
    }
    calling_ = calling;
    if (called != rules_.ae_title) {
      Reject(ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED,
             fmt::format("called as '{}' by '{}'", Harmless(called), Harmless(calling_)));
      return false;
    }
    if (!rules_.is_known(calling_)) {
      Reject(ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED,
             fmt::format("unknown AE title '{}'", Harmless(calling_)));
      return false;
    }
    return AcceptContexts();
  }

  bool AcceptContexts() {
    auto syntaxes = std::to_array<const char*>(
        {UID_LittleEndianExplicitTransferSyntax, UID_LittleEndianImplicitTransferSyntax});
    auto classes =
        std::to_array<const char*>({UID_VerificationSOPClass, kStoredClasses[0], kStoredClasses[1],
                                    kStoredClasses[2], kStoredClasses[3]});
    const OFCondition chosen = ASC_acceptContextsWithPreferredTransferSyntaxes(
        association_->params, classes.data(), static_cast<int>(classes.size()), syntaxes.data(),
        static_cast<int>(syntaxes.size()));
    if (chosen.bad() || ASC_countAcceptedPresentationContexts(association_->params) == 0) {
      Reject(ASC_REASON_SU_NOREASON,
             fmt::format("nothing that is received was proposed by '{}'", Harmless(calling_)));
      return false;
    }
    return ASC_acknowledgeAssociation(association_).good();
  }

  /// False once the association is over.
  bool ServeCommand() {
    T_ASC_PresentationContextID context = 0;
    T_DIMSE_Message message{};
    DcmDataset* detail = nullptr;
    const OFCondition received = DIMSE_receiveCommand(association_, DIMSE_NONBLOCKING,
                                                      kIdlePatience_s, &context, &message, &detail);
    delete detail;
    if (received == DUL_PEERREQUESTEDRELEASE) {
      (void)ASC_acknowledgeRelease(association_);
      (void)ASC_dropSCPAssociation(association_, kAssociatePatience_s);
      return false;
    }
    if (received.good() && message.CommandField == DIMSE_C_ECHO_RQ) {
      rules_.audit(fmt::format("echo for '{}'", Harmless(calling_)));
      return DIMSE_sendEchoResponse(association_, context, &message.msg.CEchoRQ, STATUS_Success,
                                    nullptr)
          .good();
    }
    if (received.good() && message.CommandField == DIMSE_C_STORE_RQ)
      return Store(context, message.msg.CStoreRQ);
    if (received != DUL_PEERABORTEDASSOCIATION) {
      rules_.audit(fmt::format("ended: '{}' sent no command that is served ({})",
                               Harmless(calling_), Harmless(received.text())));
      (void)ASC_abortAssociation(association_);
    }
    return false;
  }

  /// Whether the presentation context of the command is the one of the class that it names.
  bool IsOfClass(T_ASC_PresentationContextID id, const T_DIMSE_C_StoreRQ& request) {
    T_ASC_PresentationContext context{};
    return ASC_findAcceptedPresentationContext(association_->params, id, &context).good() &&
           std::string_view(context.abstractSyntax) == request.AffectedSOPClassUID &&
           std::ranges::any_of(kStoredClasses, [&](const char* one) {
             return std::string_view(one) == request.AffectedSOPClassUID;
           });
  }

  bool Store(T_ASC_PresentationContextID context, T_DIMSE_C_StoreRQ& request) {
    request_file_ = IsOfClass(context, request) ? rules_.new_file() : std::nullopt;
    refusal_ = !IsOfClass(context, request) ? STATUS_STORE_Refused_SOPClassNotSupported
               : !request_file_             ? STATUS_STORE_Refused_OutOfResources
                                            : STATUS_Success;
    // Into the void where it is refused, because the sender cannot be stopped.
    const std::string file = request_file_ ? request_file_->string() : "/dev/null";
    const OFCondition stored =
        DIMSE_storeProvider(association_, context, &request, file.c_str(), /*writeMetaheader=*/1,
                            nullptr, &AtTheEnd, this, DIMSE_NONBLOCKING, kAnswerPatience_s);
    if (stored.bad()) {
      if (request_file_) {
        std::error_code error;
        std::filesystem::remove(*request_file_, error);
      }
      rules_.audit(
          fmt::format("ended: '{}' broke off ({})", Harmless(calling_), Harmless(stored.text())));
      (void)ASC_abortAssociation(association_);
    }
    return stored.good();
  }

  /// DCMTK has closed the file and not answered yet.
  static void AtTheEnd(void* data, T_DIMSE_StoreProgress* progress, T_DIMSE_C_StoreRQ* request,
                       char* /*file*/, DcmDataset** /*set*/, T_DIMSE_C_StoreRSP* response,
                       DcmDataset** detail) {
    *detail = nullptr;
    if (progress->state != DIMSE_StoreEnd) return;
    auto& self = *static_cast<Receiver*>(data);
    if (self.refusal_ != STATUS_Success) {
      response->DimseStatus = self.refusal_;
    } else if (response->DimseStatus == STATUS_Success &&
               !self.rules_.keep({.file = *self.request_file_,
                                  .calling_ae_title = self.calling_,
                                  .class_uid = request->AffectedSOPClassUID,
                                  .instance_uid = request->AffectedSOPInstanceUID})) {
      response->DimseStatus = STATUS_STORE_Refused_OutOfResources;
    }
    self.rules_.audit(
        fmt::format("{} {} of '{}', status {:04X}",
                    response->DimseStatus == STATUS_Success ? "kept" : "refused",
                    Harmless(dcmFindNameOfUID(request->AffectedSOPClassUID, "another class")),
                    Harmless(self.calling_), response->DimseStatus));
  }

  const ReceiveRules& rules_;
  std::unique_ptr<DcmTransportLayer> tls_;
  T_ASC_Network* network_ = nullptr;
  T_ASC_Association* association_ = nullptr;
  std::string calling_;
  std::optional<std::filesystem::path> request_file_;
  DIC_US refusal_ = STATUS_Success;
};

}  // namespace

void ReceiveAssociation(int connection, const ReceiveRules& rules) {
  Receiver receiver(connection, rules);
  LockDown(Allowed::kStore);
  receiver.Serve();
}

}  // namespace plumb
