#pragma once
/// HTML to PDF with a program that is installed: weasyprint or chromium.

#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// Call it before a result is stored whose report becomes `pdf`: Io if no converter is installed,
/// or if there is no folder for the file.
[[nodiscard]] Result<void> check_pdf(const std::filesystem::path& pdf);

/// Writes `pdf`. Io if no converter is installed, or if it fails or takes longer than three
/// minutes. The converter reports nothing: `progress` gets the time that it has taken, as a share
/// of that time and 10 s. It takes a few seconds for a report.
[[nodiscard]] Result<void> write_pdf(const std::string& html, const std::filesystem::path& pdf,
                                     const Progress& progress = {});

}  // namespace abbe::daemon
