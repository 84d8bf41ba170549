#pragma once
/// Writes a model as compensation file of a control, and proves it.

#include "abbe/base/error.hpp"
#include "abbe/tasks/export_options.hpp"
#include "abbe/tasks/export_report.hpp"

namespace abbe::daemon {

/// The file is written to `arguments.out` only after it was read back as the control reads it, and
/// compared with what its format can hold. Refused: the model must not be used, and the arguments
/// do not force it. Usage: an option that the format does not have. DataInsufficient: the machine
/// would not become better.
/// `show_cautions` is called with a model that may be used with caution.
[[nodiscard]] Result<ExportReport> export_model(const ExportArguments& arguments,
                                                const ShowCautions& show_cautions);

}  // namespace abbe::daemon
