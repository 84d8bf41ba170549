#pragma once
/// Converts HTML to PDF with an installed program: weasyprint or chromium.

#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/tasks/progress.hpp"

namespace abbe::daemon {

/// Checks that write_pdf() can succeed. Call it before a result is stored. Io if no converter is
/// installed, or if the folder of `pdf` does not exist.
[[nodiscard]] Result<void> check_pdf(const std::filesystem::path& pdf);

/// Writes `pdf`. Io if no converter is installed, or if it fails or takes longer than three
/// minutes. The converter reports no progress. `progress` therefore gets t / (t + 10 s), where t is
/// the time so far. A report takes a few seconds.
[[nodiscard]] Result<void> write_pdf(const std::string& html, const std::filesystem::path& pdf,
                                     const Progress& progress = {});

}  // namespace abbe::daemon
