// Displays in the room.
#pragma once

#include <string>
#include <vector>

#include "web/service/change.hpp"
#include "web/service/service_types.hpp"

namespace plumb::web {

/// The rules of services.hpp hold.
class DisplayService {
 public:
  virtual ~DisplayService() = default;

  [[nodiscard]] virtual std::vector<Display> Displays() = 0;
  virtual void AddDisplay(const Actor& actor, const Display& display, Done done) = 0;
  virtual void RemoveDisplay(const Actor& actor, const std::string& id, Done done) = 0;
};

}  // namespace plumb::web
