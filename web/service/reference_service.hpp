// References, with which fractions are compared.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class ReferenceService {
 public:
  virtual ~ReferenceService() = default;

  [[nodiscard]] virtual std::vector<Reference> References(
      const std::string& patient_id) = 0;  ///< Newest version first (background).
  [[nodiscard]] virtual std::optional<Reference> FindReference(const std::string& id) = 0;
  /// Of the maps of its scan, by the room's markers that the scan contains: the reference marker
  /// may have lain otherwise than when the room was calibrated (background).
  [[nodiscard]] virtual RoomOnMap RoomOfReference(const Reference& reference) = 0;
  /// Creates a draft from a scan with a scene. Returns the id.
  virtual void AddReference(const Actor& actor, const std::string& scan_id,
                            const std::string& reason, Done done) = 0;
  /// A draft is changed in place. For an approved reference, creates a new draft with the next
  /// version and returns its id.
  /// @param revision  The revision that was read: kConflict if another has been saved since.
  virtual void PlanReference(const Actor& actor, const std::string& id, int revision,
                             const ReferencePlan& plan, Done done) = 0;
  /// kRefused for the user who created or last planned it. After approval it is immutable and used
  /// for the comparison of fractions.
  /// @param revision  The revision that was read, as above.
  /// @param digest    Digest of the data that was read and is signed; kConflict if other data is
  ///         stored. Empty: only the revision is checked.
  virtual void ApproveReference(const Actor& actor, const std::string& id, int revision,
                                const std::string& digest, Done done) = 0;
};

}  // namespace plumb::web
