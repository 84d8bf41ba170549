#pragma once
/// Makes the request for a calibration with a ball array from the files of a client.

#include <nlohmann/json_fwd.hpp>

#include "abbe/tables/evemu_files.hpp"

namespace abbe::daemon {

/// The request without the numbers of positions and points; abbed takes these from [evemu].
/// `reference`: points where V is known independently; null: none. `u_reference_m`: standard
/// uncertainty of this V, per component.
[[nodiscard]] nlohmann::json evemu_task(const CalibratorFile& calibrator,
                                        const BallErrorsFile* reference, double u_reference_m);

}  // namespace abbe::daemon
