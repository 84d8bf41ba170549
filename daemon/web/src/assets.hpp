#pragma once
/// The files of the page, embedded in the program: nothing is read from disk or network.

#include <span>
#include <string_view>

namespace abbe::web {

struct EmbeddedFile {
  std::string_view name;
  std::string_view bytes;
};
[[nodiscard]] std::span<const EmbeddedFile> assets() noexcept;

}  // namespace abbe::web
