// Code words of the marker family ARUCO_MIP_36h12: 250 codes of 36 bits, Hamming distance 12 or
// more over all rotations.
//
// Origin: the ArUco library (R. Munoz-Salinas and S. Garrido-Jurado,
// https://sourceforge.net/projects/aruco, releases 3.1.x), where the table is published under the
// 2-clause BSD licence, "Copyright 2017 Rafael Munoz Salinas. All rights reserved."; generation: S.
// Garrido-Jurado et al., "Generation of fiducial marker dictionaries using Mixed Integer Linear
// Programming", Pattern Recognition 51 (2016). The words are facts that every print of the family
// shares; they were compared between the copy in js-aruco2 2.0.0 and a second, independent one, and
// the distances are computed again by a test.
//
// Redistribution and use in source and binary forms, with or without modification, are permitted
// provided that redistributions of source code retain the above copyright notice, this list of
// conditions and the following disclaimer, and redistributions in binary form reproduce them in the
// documentation and/or other materials provided with the distribution. THIS SOFTWARE IS PROVIDED BY
// RAFAEL MUNOZ SALINAS "AS IS" AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED
// TO, THE IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE
// DISCLAIMED. IN NO EVENT SHALL RAFAEL MUNOZ SALINAS OR CONTRIBUTORS BE LIABLE FOR ANY DIRECT,
// INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL DAMAGES (INCLUDING, BUT NOT LIMITED
// TO, PROCUREMENT OF SUBSTITUTE GOODS OR SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS
// INTERRUPTION) HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT
// LIABILITY, OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE OF THIS
// SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.
#pragma once

#include <array>
#include <cstdint>

namespace plumb {

/// Row-major from the top left, the first cell in the highest of 36 bits, 1 = white.
// clang-format off
inline constexpr std::array<std::uint64_t, 250> kArucoMip36h12Codes = {
    0xd2b63a09dULL, 0x6001134e5ULL, 0x1206fbe72ULL, 0xff8ad6cb4ULL, 0x85da9bc49ULL, 0xb461afe9cULL, 0x6db51fe13ULL, 0x5248c541fULL, 0x008f34503ULL, 0x8ea462eceULL,
    0xeac2be76dULL, 0x1af615c44ULL, 0xb48a49f27ULL, 0x2e4e1283bULL, 0x78b1f2fa8ULL, 0x27d34f57eULL, 0x89222fff1ULL, 0x4c1669406ULL, 0xbf49b3511ULL, 0xdc191cd5dULL,
    0x11d7c3f85ULL, 0x16a130e35ULL, 0xe29f27effULL, 0x428d8ae0cULL, 0x90d548477ULL, 0x2319cbc93ULL, 0xc3b0c3dfcULL, 0x0424bccc9ULL, 0x2a081d630ULL, 0x762743d96ULL,
    0xd0645bf19ULL, 0xf38d7fd60ULL, 0xc6cbf9a10ULL, 0x3c1be7c65ULL, 0x276f75e63ULL, 0x4490a3f63ULL, 0xda60acd52ULL, 0x3cc68df59ULL, 0xab46f9daeULL, 0x88d533d78ULL,
    0xb6d62ec21ULL, 0xb3c02b646ULL, 0x22e56d408ULL, 0xac5f5770aULL, 0xaaa993f66ULL, 0x4caa07c8dULL, 0x5c9b4f7b0ULL, 0xaa9ef0e05ULL, 0x0705c5750ULL, 0xac81f545eULL,
    0x735b91e74ULL, 0x8cc35cee4ULL, 0xe44694d04ULL, 0xb5e121de0ULL, 0x261017d0fULL, 0xf1d439eb5ULL, 0xa1a33ac96ULL, 0x174c62c02ULL, 0x1ee27f716ULL, 0x8b1c5ece9ULL,
    0x6a05b0c6aULL, 0x0d0568dfcULL, 0x192d25e5fULL, 0x1adbeccc8ULL, 0xcfec87f00ULL, 0xd0b9dde7aULL, 0x88dcef81eULL, 0x445681cb9ULL, 0xdbb2ffc83ULL, 0xa48d96df1ULL,
    0xb72cc2e7dULL, 0x0c295b53fULL, 0xf49832704ULL, 0x9968edc29ULL, 0x9e4e1af85ULL, 0x8683e2d1bULL, 0x810b45c04ULL, 0x6ac44bfe2ULL, 0x645346615ULL, 0x3990bd598ULL,
    0x1c9ed0f6aULL, 0xc26729d65ULL, 0x83993f795ULL, 0x3ac05ac5dULL, 0x357adff3bULL, 0x0d5c05565ULL, 0x2f547ef44ULL, 0x86c115041ULL, 0x640fd9e5fULL, 0xce08bbcf7ULL,
    0x109bb343eULL, 0xc21435c92ULL, 0x35b4dfce4ULL, 0x459752cf2ULL, 0xec915b82cULL, 0x51881eed0ULL, 0x2dda7dc97ULL, 0x2e0142144ULL, 0x42e890f99ULL, 0x9a8856527ULL,
    0x8e80d9d80ULL, 0x891cbcf34ULL, 0x25dd82410ULL, 0x239551d34ULL, 0x8fe8f0c70ULL, 0x94106a970ULL, 0x82609b40cULL, 0x0fc9caf36ULL, 0x688181d11ULL, 0x718613c08ULL,
    0x0f1ab7629ULL, 0xa357bfc18ULL, 0x4c03b7a46ULL, 0x204dedce6ULL, 0xad6300d37ULL, 0x84cc4cd09ULL, 0x42160e5c4ULL, 0x87d2adfa8ULL, 0x7850e7749ULL, 0x4e750fc7cULL,
    0xbf2e5dfdaULL, 0xd88324da5ULL, 0x234b52f80ULL, 0x378204514ULL, 0xabdf2ad53ULL, 0x365e78ef9ULL, 0x49caa6ca2ULL, 0x03c39ddf3ULL, 0xc68c5385dULL, 0x5bfcbbf67ULL,
    0x623241e21ULL, 0xabc90d5ccULL, 0x388c6fe85ULL, 0xda0e2d62dULL, 0x10855dfe9ULL, 0x4d46efd6bULL, 0x76ea12d61ULL, 0x9db377d3dULL, 0xeed0efa71ULL, 0xe6ec3ae2fULL,
    0x441faee83ULL, 0xba19c8ff5ULL, 0x313035eabULL, 0x6ce8f7625ULL, 0x880dab58dULL, 0x8d3409e0dULL, 0x2be92ee21ULL, 0xd60302c6cULL, 0x469ffc724ULL, 0x87eebeed3ULL,
    0x42587ef7aULL, 0x7a8cc4e52ULL, 0x76a437650ULL, 0x999e41ef4ULL, 0x7d0969e42ULL, 0xc02baf46bULL, 0x9259f3e47ULL, 0x2116a1dc0ULL, 0x9f2de4d84ULL, 0x00effac29ULL,
    0x7b371ff8cULL, 0x668339da9ULL, 0xd010aee3fULL, 0x1cd00b4c0ULL, 0x95070fc3bULL, 0xf84c9a770ULL, 0x38f863d76ULL, 0x3646ff045ULL, 0xce1b96412ULL, 0x7a5d45da8ULL,
    0x14e00ef6cULL, 0x5e95abfd8ULL, 0xb2e9cb729ULL, 0x036c47dd7ULL, 0xb8ee97c6bULL, 0x0e9e8f657ULL, 0xd4ad2ef1aULL, 0x8811c7f32ULL, 0x47bde7c31ULL, 0x3adadfb64ULL,
    0x6e5b28574ULL, 0x33e67cd91ULL, 0x2ab9fdd2dULL, 0x8afa67f2bULL, 0xe6a28fc5eULL, 0x72049cdbdULL, 0xae65dac12ULL, 0x1251a4526ULL, 0x1089ab841ULL, 0xe2f096ee0ULL,
    0xb0caee573ULL, 0xfd6677e86ULL, 0x444b3f518ULL, 0xbe8b3a56aULL, 0x680a75cfcULL, 0xac02baea8ULL, 0x97d815e1cULL, 0x1d4386e08ULL, 0x1a14f5b0eULL, 0xe658a8d81ULL,
    0xa3868efa7ULL, 0x3668a9673ULL, 0xe8fc53d85ULL, 0x2e2b7edd5ULL, 0x8b2470f13ULL, 0xf69795f32ULL, 0x4589ffc8eULL, 0x2e2080c9cULL, 0x064265f7dULL, 0x3d714dd10ULL,
    0x1692c6ef1ULL, 0x3e67f2f49ULL, 0x5041dad63ULL, 0x1a1503415ULL, 0x64c18c742ULL, 0x0a72eec35ULL, 0x1f0f9dc60ULL, 0xa9559bc67ULL, 0xf32911d0dULL, 0x21c0d4ffcULL,
    0xe01cef5b0ULL, 0x4e23a3520ULL, 0xaa4f04e49ULL, 0xe1c4fcc43ULL, 0x208e8f6e8ULL, 0x8486774a5ULL, 0x9e98c7558ULL, 0x2c59fb7dcULL, 0x9446a4613ULL, 0x8292dcc2eULL,
    0x004d61631ULL, 0xd05527809ULL, 0xa0163852dULL, 0x8f657f639ULL, 0xcca6c3e37ULL, 0xcb136bc7aULL, 0xfc5a83e53ULL, 0x9aa44fc30ULL, 0xbdec1bd3cULL, 0xe020b9f7cULL,
    0x4b8f35fb0ULL, 0xb8165f637ULL, 0x33dc88d69ULL, 0x10a2f7e4dULL, 0xc8cb5ff53ULL, 0xde259ff6bULL, 0x46d070dd4ULL, 0x32d3b9741ULL, 0x7075f1c04ULL, 0x4d58dbea0ULL,
};
// clang-format on

}  // namespace plumb
