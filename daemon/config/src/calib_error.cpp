#include "abbe/config/calib_error.hpp"

namespace abbe::daemon {

Error error_of(const calib::Error& error) {
  const bool input =
      error.code == calib::ErrorCode::BadInput || error.code == calib::ErrorCode::NotFinite;
  return {input ? ErrorCode::BadInput : ErrorCode::DataInsufficient, error.text};
}

}  // namespace abbe::daemon
