// SPDX-License-Identifier: Apache-2.0
#include "drivers/dicom/dicom_association.hpp"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>

#include <dcmtk/dcmtls/tlslayer.h>

#include <array>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "words/dicom.hpp"

namespace plumb {
namespace {

/// While files may still be read; DCMTK gets a number.
std::string AddressOf(const DicomPeer& peer) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(peer.host.c_str(), nullptr, &hints, &found);
  if (error != 0) throw DataError(say::dicom::NoHost(peer.host, ::gai_strerror(error)));
  std::array<char, NI_MAXHOST> text{};
  (void)::getnameinfo(found->ai_addr, found->ai_addrlen, text.data(), text.size(), nullptr, 0,
                      NI_NUMERICHOST);
  ::freeaddrinfo(found);
  return text.data();
}

[[noreturn]] void FailOn(const OFCondition& condition, const DicomPeer& peer,
                         T_ASC_Parameters* parameters) {
  const std::string node = fmt::format("{}@{}:{}", peer.ae_title, peer.host, peer.port);
  if (condition != DUL_ASSOCIATIONREJECTED)
    throw DataError(say::dicom::NoAssociation(node, ValidUtf8(condition.text())));
  T_ASC_RejectParameters why{};
  ASC_getRejectParameters(parameters, &why);
  switch (why.reason) {
    case ASC_REASON_SU_CALLEDAETITLENOTRECOGNIZED:
      throw DataError(say::dicom::CalledUnknown(node, peer.ae_title));
    case ASC_REASON_SU_CALLINGAETITLENOTRECOGNIZED:
      throw DataError(say::dicom::CallingUnknown(node));
    default: {
      OFString text;
      ASC_printRejectParameters(text, &why);
      throw DataError(say::dicom::Rejected(node, ValidUtf8(text.c_str())));
    }
  }
}

}  // namespace

DicomAssociation::DicomAssociation(const DicomPeer& peer, const std::string& own_ae_title,
                                   const DicomTlsFiles& tls, int patience_s)
    : peer_(peer), patience_s_(patience_s) {
  Check(ASC_initializeNetwork(NET_REQUESTOR, 0, patience_s_, &network_));
  Check(ASC_createAssociationParameters(&parameters_, ASC_DEFAULTMAXPDU));
  if (!tls.empty()) {
    tls_ = MakeDicomTls(tls, DicomRole::kSends);
    Check(ASC_setTransportLayer(network_, tls_.get(), 0));
    Check(ASC_setTransportLayerType(parameters_, OFTrue));
  }
  Check(ASC_setAPTitles(parameters_, own_ae_title.c_str(), peer.ae_title.c_str(), nullptr));
  const std::string to = fmt::format("{}:{}", AddressOf(peer), peer.port);
  Check(ASC_setPresentationAddresses(parameters_, "localhost", to.c_str()));
}

DicomAssociation::~DicomAssociation() = default;

void DicomAssociation::Propose(const std::string& class_uid,
                               const std::vector<const char*>& syntaxes) {
  auto names = syntaxes;
  Check(ASC_addPresentationContext(parameters_, next_, class_uid.c_str(), names.data(),
                                   static_cast<int>(names.size())));
  next_ = static_cast<T_ASC_PresentationContextID>(next_ + 2);
}

void DicomAssociation::Request() {
  // The parameters are the association's from now on.
  const OFCondition asked = ASC_requestAssociation(network_, parameters_, &association_, nullptr,
                                                   nullptr, DUL_NOBLOCK, patience_s_);
  if (asked.bad()) FailOn(asked, peer_, parameters_);
}

void DicomAssociation::Check(const OFCondition& condition) const {
  if (condition.bad()) FailOn(condition, peer_, parameters_);
}

}  // namespace plumb
