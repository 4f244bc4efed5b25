// SPDX-License-Identifier: Apache-2.0
// The page's and its tests' JavaScript by ESLint, its style sheets by stylelint: lint.mjs
// NODE_MODULES SOURCE_FOLDER
import { createRequire } from 'node:module';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';

const [modules, source] = process.argv.slice(2);
const load = createRequire(join(modules, 'index.js'));
const { ESLint } = load('eslint');
const js = load('@eslint/js');
const globals = load('globals');

const rules = {
  ...js.configs.recommended.rules,
  'array-callback-return': 'error',
  'consistent-return': 'error',
  curly: ['error', 'multi-line'],
  eqeqeq: 'error',
  'no-constructor-return': 'error',
  'no-duplicate-imports': 'error',
  'no-else-return': 'error',
  'no-eval': 'error',
  'no-implicit-globals': 'error',
  'no-implied-eval': 'error',
  'no-inner-declarations': 'error',
  'no-new-func': 'error',
  'no-param-reassign': 'error',
  'no-promise-executor-return': 'error',
  'no-script-url': 'error',
  'no-self-compare': 'error',
  'no-shadow': 'error',
  'no-template-curly-in-string': 'error',
  'no-throw-literal': 'error',
  'no-unreachable-loop': 'error',
  'no-unused-expressions': 'error',
  'no-unused-vars': ['error', { ignoreRestSiblings: true }],
  'no-use-before-define': ['error', { functions: false, variables: false }],
  'no-useless-return': 'error',
  'no-var': 'error',
  'max-len': ['error', { code: 100 }],
  'object-shorthand': 'error',
  'prefer-const': 'error',
  'prefer-promise-reject-errors': 'error',
  radix: 'error',
  // Markup in strings is how what people type would become script.
  'no-restricted-syntax': ['error', ...[
    'AssignmentExpression[left.property.name=/^(inner|outer)HTML$/]',
    'CallExpression[callee.property.name="insertAdjacentHTML"]',
    'CallExpression[callee.object.name="document"][callee.property.name=/^write(ln)?$/]',
  ].map((selector) => ({ selector, message: 'Build elements with h() and svg() of dom.js.' }))],
};
const language = (names) => ({
  ecmaVersion: 2023, sourceType: 'module',
  globals: Object.assign({}, ...names.map((n) => globals[n])),
});
const eslint = new ESLint({
  cwd: source,
  overrideConfigFile: true,
  overrideConfig: [
    { linterOptions: { reportUnusedDisableDirectives: 'error', noInlineConfig: true }, rules },
    { files: ['web/page/**/*.js'], languageOptions: language(['browser']) },
    { files: ['web/page/language.js'],
      languageOptions: { globals: { PLUMB_LANGUAGES: 'readonly' } } },
    // Tests hold functions that run in the browser.
    { files: ['**/*.mjs'], languageOptions: language(['node', 'browser']) },
  ],
});
const results = await eslint.lintFiles(
  ['web/page/**/*.js', 'web/page/*.mjs', 'tests/web/*.mjs']);
const { format } = await eslint.loadFormatter('stylish');
const text = await format(results);
console.log(text || `all well: ${results.length} files`);

const flags = (names) => Object.fromEntries(names.map((name) => [name, true]));
const { default: stylelint } = await import(
  pathToFileURL(join(modules, 'stylelint/lib/index.mjs')));
const styles = await stylelint.lint({
  files: join(source, 'web/page/**/*.css'),
  formatter: 'string',
  config: {
    reportInvalidScopeDisables: true, reportNeedlessDisables: true,
    rules: {
      ...flags([
        'annotation-no-unknown', 'at-rule-no-unknown', 'block-no-empty', 'color-no-invalid-hex',
        'comment-no-empty', 'custom-property-no-missing-var-function',
        'declaration-block-no-duplicate-custom-properties',
        'declaration-block-no-shorthand-property-overrides', 'font-family-no-duplicate-names',
        'font-family-no-missing-generic-family-keyword', 'function-calc-no-unspaced-operator',
        'function-linear-gradient-no-nonstandard-direction', 'function-no-unknown',
        'keyframe-block-no-duplicate-selectors', 'keyframe-declaration-no-important',
        'length-zero-no-unit', 'media-feature-name-no-unknown',
        'media-feature-name-value-no-unknown', 'media-query-no-invalid',
        'named-grid-areas-no-invalid', 'no-duplicate-at-import-rules', 'no-duplicate-selectors',
        'no-empty-source', 'no-invalid-double-slash-comments', 'no-unknown-animations',
        'no-unknown-custom-properties', 'property-no-unknown', 'selector-anb-no-unmatchable',
        'selector-pseudo-class-no-unknown', 'selector-pseudo-element-no-unknown',
        'selector-type-no-unknown', 'shorthand-property-no-redundant-values',
        'string-no-newline', 'unit-no-unknown',
      ]),
      'color-named': 'never',
      // An older value before a newer one is for browsers that do not know the latter.
      'declaration-block-no-duplicate-properties':
        [true, { ignore: ['consecutive-duplicates-with-different-values'] }],
      // System colours of forced-colors mode are unknown to it.
      'declaration-property-value-no-unknown':
        [true, { ignoreProperties: { '/^(border|fill|stroke)$/': /CanvasText/ } }],
    },
  },
});
console.log(styles.report || `all well: ${styles.results.length} style sheets`);

// A glob that finds nothing is no success.
const isWell = results.length > 30
  && results.every((one) => one.errorCount + one.warningCount === 0)
  && styles.results.length > 0 && !styles.errored;
process.exit(isWell ? 0 : 1);
