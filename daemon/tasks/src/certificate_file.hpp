#pragma once
/// certificate.toml: people, firms, serial numbers and conditions of a report or certificate.

#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/report/certificate_details.hpp"

namespace abbe::daemon {

/// Reads the file; every entry is optional. BadInput with all faults.
[[nodiscard]] Result<CertificateDetails> read_certificate_toml(const std::filesystem::path& file);

}  // namespace abbe::daemon
