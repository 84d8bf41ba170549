#pragma once
/// A recorded run identified again, with other options than live.

#include <string>
#include <variant>

#include "abbe/base/error.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/identify_evemu.hpp"
#include "abbe/tasks/identify_mfb.hpp"
#include "abbe/tasks/identify_otf.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// Of each method those that name a recording.
using AgainArguments =
    std::variant<IdentifyOtfArguments, IdentifyEvemuArguments, IdentifyMfbArguments>;

struct IdentifiedAgain {
  ModelDocument document;  ///< with the verdict of the gate
  std::string figures;     ///< the held-out residuals, in words
};

/// As `abbe identify METHOD --recording FILE`; writes nothing. DataInsufficient soon after
/// progress.stopped(), at the latest when the identification with a bar or an array that is under
/// way has ended.
[[nodiscard]] Result<IdentifiedAgain> identify_again(const AgainArguments& arguments,
                                                     const Progress& progress);

}  // namespace abbe::daemon
