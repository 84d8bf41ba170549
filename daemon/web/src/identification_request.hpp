#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/tasks/identify_again.hpp"

namespace abbe::web {

struct IdentificationRequest {
  std::string recording;             ///< name in the folder of recordings
  daemon::AgainArguments arguments;  ///< without files
  bool present_configuration = false;
  std::vector<std::string> options;  ///< what differs from the live run: "tables cubic"
  std::vector<std::string> accept;   ///< conditions of the gate
};

/// What a page asks for. `body`:
///
///     {"name": RECORDING, "method": "otf", "configuration": "recorded" | "present",
///      "tables": WORD, "backlash": WORD, "smoothness_um": TEXT, "estimator": WORD,
///      "accept": [NAME, ...]}
///     {"name": RECORDING, "method": "evemu", ..., "estimator": WORD, "order": NUMBER}
///     {"name": RECORDING, "method": "mfb", ..., "estimator": WORD}
///
/// Members have the words and units of the options of `abbe identify METHOD`; all but "name" and
/// "method" may be missing: then the configuration decides. Usage for an unknown member, method or
/// word, with what is possible. Throws nlohmann::json::exception for a member of the wrong type.
[[nodiscard]] daemon::Result<IdentificationRequest> identification_request(
    const nlohmann::json& body);

}  // namespace abbe::web
