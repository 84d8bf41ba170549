#pragma once
/// The report at the identification and the report that the store gives later.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "abbe_command.hpp"
#include "text_files.hpp"

namespace abbe::daemon::test {

/// Options of an identification whose report is compared.
inline constexpr const char* kKept = "--keep kept -o kept_out --json";

/// Runs `abbe report` on the model of an identification with the options kKept: both reports must
/// have the same bytes. Returns the report; empty after a failure.
inline std::string expect_same_report_from_store(const std::filesystem::path& folder,
                                                 const Ran& identified) {
  const auto summary = nlohmann::json::parse(identified.out, nullptr, false);
  EXPECT_TRUE(summary.is_object() && summary.contains("id")) << identified.out << identified.err;
  if (!summary.is_object() || !summary.contains("id")) return {};
  const auto again = run_abbe(folder, fmt::format("report {} --store kept -o again.html",
                                                  summary["id"].get<std::string>()));
  EXPECT_EQ(again.exit, 0) << again.err;
  const std::string page = text_of(folder / "kept_out" / "report.html");
  EXPECT_EQ(page, text_of(folder / "again.html"));
  return page;
}

}  // namespace abbe::daemon::test
