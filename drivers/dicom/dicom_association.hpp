// SPDX-License-Identifier: Apache-2.0
// An association with another node of a DICOM network, with DCMTK.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <dcmtk/config/osconfig.h>

#include <dcmtk/dcmnet/assoc.h>

#include "drivers/dicom/dicom_network.hpp"
#include "drivers/dicom/send_content.hpp"

namespace plumb {

/// From its request to its release. DCMTK's DcmSCU would be shorter, but it does not tell why an
/// association was rejected. The process ends with its work; the kernel closes what is open.
class DicomAssociation {
 public:
  /// Looks up the host and loads the certificates: afterwards no file is opened any more. The node
  /// is borrowed.
  /// @throws DataError
  /// @param patience_s  For the other side's answer to the request.
  DicomAssociation(const DicomPeer& peer, const std::string& own_ae_title, const DicomTlsFiles& tls,
                   int patience_s = kAssociatePatience_s);
  ~DicomAssociation();
  DicomAssociation(const DicomAssociation&) = delete;
  DicomAssociation& operator=(const DicomAssociation&) = delete;

  /// One more class, at most kMostContexts of them.
  void Propose(const std::string& class_uid, const std::vector<const char*>& syntaxes);
  /// @throws DataError with the other side's reason.
  void Request();
  void Release() { (void)ASC_releaseAssociation(association_); }

  [[nodiscard]] T_ASC_Association* get() const { return association_; }

  static constexpr std::size_t kMostContexts = 128;  // their numbers are odd and below 256

 private:
  void Check(const OFCondition& condition) const;

  const DicomPeer& peer_;
  const int patience_s_;
  std::unique_ptr<DcmTransportLayer> tls_;
  T_ASC_Network* network_ = nullptr;
  T_ASC_Parameters* parameters_ = nullptr;
  T_ASC_Association* association_ = nullptr;
  T_ASC_PresentationContextID next_ = 1;
};

}  // namespace plumb
