#pragma once
/// Writes a model as compensation file of a control, and verifies the file.

#include "abbe/base/error.hpp"
#include "abbe/tasks/export_options.hpp"
#include "abbe/tasks/export_report.hpp"

namespace abbe::daemon {

/// The text of the file is first read back as the control reads it, and compared with the
/// correction that its format can hold. Only then the file is written to `arguments.out`. Refused:
/// the model must not be used, and the arguments do not force the use. Usage: the format does not
/// have one of the options. DataInsufficient: the correction would not improve the machine.
/// `show_cautions` is called with a model that may be used with caution.
[[nodiscard]] Result<ExportReport> export_model(const ExportArguments& arguments,
                                                const ShowCautions& show_cautions);

}  // namespace abbe::daemon
