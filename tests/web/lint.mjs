// The page's and its tests' JavaScript by ESLint: lint.mjs NODE_MODULES SOURCE_FOLDER
import { createRequire } from 'node:module';
import { join } from 'node:path';

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
    { files: ['web/assets/**/*.js'], languageOptions: language(['browser']) },
    // Tests hold functions that run in the browser; a step is a list of long lines.
    {
      files: ['**/*.mjs'], languageOptions: language(['node', 'browser']),
      rules: { 'max-len': 'off' },
    },
  ],
});
const results = await eslint.lintFiles(
  ['web/assets/**/*.js', 'web/assets/*.mjs', 'tests/web/*.mjs']);
const { format } = await eslint.loadFormatter('stylish');
const text = await format(results);
console.log(text || `all well: ${results.length} files`);
// A glob that finds nothing is no success.
process.exit(results.length > 30 && results.every((one) => one.errorCount + one.warningCount === 0)
  ? 0 : 1);
