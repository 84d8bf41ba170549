#pragma once
/// HTML to PDF with a program that is installed: weasyprint or chromium.

#include <filesystem>
#include <string>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Writes `pdf`. Io if no converter is installed, or if it fails or takes longer than three
/// minutes.
[[nodiscard]] Result<void> write_pdf(const std::string& html, const std::filesystem::path& pdf);

}  // namespace abbe::daemon
