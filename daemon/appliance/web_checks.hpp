// The page's service for the daily check.
#pragma once

#include "daemon/appliance/store_access.hpp"
#include "web/service/check_service.hpp"

namespace plumb {

/// Its arguments are borrowed.
class WebChecks : public web::CheckService {
 public:
  WebChecks(Appliance& appliance, StoreAccess& store) : appliance_(appliance), store_(store) {}

  [[nodiscard]] web::CheckStatus GetChecks() override;
  void OpenCheck(const web::Actor& actor, web::Done done) override;
  void SetCheckBaseline(const web::Actor& actor, const std::string& check_id,
                        web::Done done) override;

 private:
  Appliance& appliance_;
  StoreAccess& store_;
};

}  // namespace plumb
