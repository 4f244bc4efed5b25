// References: what fractions are compared with.
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
      const std::string& patient_id) = 0;  ///< Newest version first (aside).
  [[nodiscard]] virtual std::optional<Reference> FindReference(const std::string& id) = 0;
  /// A draft made of a scan with a scene. Gives the id.
  virtual void AddReference(const Actor& actor, const std::string& scan_id,
                            const std::string& reason, Done done) = 0;
  /// Of a draft: changed in place. Of an approved one: a new draft with the next version; gives its
  /// id.
  /// @param revision  That was read: kConflict if another has been saved since.
  virtual void PlanReference(const Actor& actor, const std::string& id, int revision,
                             const ReferencePlan& plan, Done done) = 0;
  /// kRefused for the user who made or last planned it. From then on it is immutable and the one
  /// that fractions are compared with.
  /// @param revision  That was read, as above.
  /// @param digest    Of what was read and is signed; kConflict where it is not what is stored.
  ///                  Empty: the revision alone.
  virtual void ApproveReference(const Actor& actor, const std::string& id, int revision,
                                const std::string& digest, Done done) = 0;
};

}  // namespace plumb::web
