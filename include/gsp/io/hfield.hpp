#pragma once
#include <filesystem>
#include <gsp/io/detail/bytes.hpp>
#include <gsp/model/description.hpp>
#include <span>
#include <string>

/// Height fields from pictures, MuJoCo's binary files and numbers in a model (docs/io/hfield.md). Elevations come out in MuJoCo's order,
/// the row at -y first, the column at -x first in it, the lowest 0 and the highest 1; sizes are set by the caller.

namespace gsp::io {

/// A height field from the bytes of a file: PNG by extension or content type "image/png", anything else MuJoCo's binary format. `file` is
/// named in messages and lends its stem as the name. Throws Error("FILE: byte: what is wrong; remedy").
HeightFieldDescription parse_hfield(Bytes bytes, std::string const& file, std::string const& content_type = {});

HeightFieldDescription read_hfield(std::filesystem::path const& path, std::string const& content_type = {});

/// A height field from numbers as they stand in a model, the row at +y first; no numbers: flat. `what` names it in messages.
HeightFieldDescription make_hfield(int rows, int columns, std::span<double const> elevation, std::string const& what);

}  // namespace gsp::io

#if !defined(GSP_COMPILED)
#include <gsp/io/detail/hfield_impl.hpp>
#endif
