#include "machine_hold.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <string_view>
#include <system_error>

#include "abbe/base/text_file.hpp"

namespace abbe::daemon {
namespace {

/// First line of the file while a motion is under way.
constexpr std::string_view kMoving = "a motion is under way\n";
constexpr std::string_view kSince = "since before the restart: ";

void write_hold(const std::filesystem::path& file, const drivers::IppMachine& machine) {
  std::error_code failed;
  if (machine == drivers::IppMachine{}) {
    std::filesystem::remove(file, failed);
    if (failed)
      fmt::print(stderr, "abbed: {}: cannot be removed: {}\n", file.string(), failed.message());
    return;
  }

  auto written = create_folder(file.parent_path());
  if (written)
    written = replace_file(file, fmt::format("{}{}", machine.moving ? kMoving : "", machine.held));
  if (!written)
    fmt::print(stderr,
               "abbed: {}: not saved; after a restart the measuring machine will not await a "
               "release\n",
               written.error().text);
}

drivers::IppMachine unreadable(const std::filesystem::path& file, const std::string& why) {
  return {fmt::format("{}unknown reason, {} cannot be read: {}", kSince, file.string(), why), true};
}

/// State of the machine from the file. A missing file means that the machine awaits no release. If
/// the file cannot be read, the machine is taken to await one.
drivers::IppMachine read_hold(const std::filesystem::path& file) {
  std::error_code failed;
  const auto status = std::filesystem::status(file, failed);
  if (status.type() == std::filesystem::file_type::not_found) return {};
  if (failed) return unreadable(file, failed.message());

  auto content = read_regular_file(file);
  if (!content) return unreadable(file, content.error().text);
  constexpr std::size_t kMost = 4096;
  std::string text = content->substr(0, kMost);
  const bool moving = text.starts_with(kMoving);
  if (moving) text.erase(0, kMoving.size());
  if (text.empty()) text = moving ? "abbed ended while the machine was moving" : "unknown reason";
  if (!text.starts_with(kSince)) text.insert(0, kSince);

  return {text, moving};
}

}  // namespace

void keep_hold(const std::filesystem::path& data_dir, drivers::IppDeviceOptions& options) {
  const auto file = data_dir / "machine-hold";
  const drivers::IppMachine machine = read_hold(file);
  options.session.held = machine.held;
  options.session.moving = machine.moving;
  options.machine_changed = [file](const drivers::IppMachine& m) { write_hold(file, m); };
}

}  // namespace abbe::daemon
